"""Materials of Wavefront MTL files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from iprt.files.message_text import printable
from iprt.geometry.material import MAX_EMISSION, Material
from iprt.geometry.reflectance import MAX_IOR, color_of, metal_or_not, triple
from iprt.geometry.textures import Textures

GLOSSY_SPECULAR = 0.04
"""Least specular reflectance (Ks) of an MTL material that gets a coat."""
_READ_KEYS = {"map_kd", "kd", "ks", "ns", "ni", "pr", "pm", "name", "image", "diffuse", "specular"}
_MAPS = {"bump", "norm", "disp", "refl"}
_SAYS_NOTHING = {"ambient", "ka", "glossiness", "illum"}
"""Keys without meaning here: ambient light, and glossiness, which repeats `ns`."""
SMOOTH = 900.0
"""Exponent (Ns) from which glass is smooth; exporters limit it to 1,000."""
REFRACTION = (6.0, 7.0)
"""MTL's illumination models (illum) in which light is refracted."""


def from_mtl(source: Any, textures: Textures, dropped: list[str]) -> Material:
    """Convert an MTL material, with its emission (Ke) and opacity (d or 1 - Tr)."""
    values = source.kwargs
    emission = triple(values.get("ke", [0.0, 0.0, 0.0]), MAX_EMISSION)
    material = replace(_reflectance_of_mtl(source, textures, dropped), emission=emission)
    if material.kind == "dielectric":
        return material
    opacity = _first(values.get("d"), 1.0 - _first(values.get("tr"), 0.0))
    # Some exporters write Tr 1 for opaque surfaces; invisible ones make no sense.
    return replace(material, opacity=min(opacity, 1.0) if opacity > 0.0 else 1.0)


def _reflectance_of_mtl(source: Any, textures: Textures, dropped: list[str]) -> Material:
    """Convert an MTL material: diffuse (Kd), with a coat if Ks and the exponent Ns are glossy.

    A Phong exponent n is about as wide as GGX with alpha = sqrt(2 / (n + 2)) (Walter et al.,
    "Microfacet Models for Refraction", 2007, section 5.2, for Beckmann). Roughness (Pr) and
    metalness (Pm) mean the same as in glTF and take precedence. Where light is refracted (illum),
    it is a dielectric, whose surface lets the share Tf of the light through.
    """
    values = source.kwargs
    albedo = color_of(values.get("kd", [1.0, 1.0, 1.0]))
    texture = textures.linear(source.image)
    # Most files repeat the color texture as map_Ka.
    read = {"map_ka"} if texture is not None else set()
    dropped.extend(_unread_mtl({key: values[key] for key in values if key not in read}))
    exponent = _first(values.get("ns"), 0.0)
    ior = _first(values.get("ni"), 0.0)
    ior = ior if 1.0 < ior <= MAX_IOR else Material.ior
    if _first(values.get("illum"), 0.0) in REFRACTION:
        passed = color_of(values.get("tf", [1.0, 1.0, 1.0]))
        rough = float(np.sqrt(2.0 / (exponent + 2.0))) if 1.0 <= exponent < SMOOTH else 0.0
        return Material("dielectric", passed, alpha=rough, ior=ior)
    alpha = float(np.sqrt(2.0 / (exponent + 2.0))) if exponent >= 1.0 else 1.0
    if "pr" in values or "pm" in values:
        roughness = _first(values.get("pr"), float(np.sqrt(alpha)))
        metallic = _first(values.get("pm"), 0.0)
        return metal_or_not(albedo, metallic, roughness, texture)
    specular = max(color_of(values.get("ks", [0.0, 0.0, 0.0])))
    if specular >= GLOSSY_SPECULAR and exponent >= 1.0:
        return Material("plastic", albedo, alpha=alpha, ior=ior, texture=texture)
    return Material("diffuse", albedo, texture=texture)


def _unread_mtl(values: dict[str, Any]) -> Iterator[str]:
    """Yield a phrase for each unsupported property of an MTL material."""
    if "map_d" in values:
        yield "map of opacity"
    for key in sorted(set(values) - _READ_KEYS - _SAYS_NOTHING - {"d", "map_d", "tr", "ke"}):
        if key.startswith("map_") or key in _MAPS:
            yield f"texture {printable(key)}"
        elif key == "tf":
            refracts = _first(values.get("illum"), 0.0) in REFRACTION
            if min(color_of(values[key])) < 1.0 and not refracts:
                yield "a transmission filter (Tf)"
        elif _first(values[key], 1.0) != 0.0:
            yield f"'{printable(key)}' of its materials"


def _first(value: Any, default: float) -> float:
    """Return an MTL number, given as a float or a list with one."""
    try:
        number = float(np.ravel(value)[0]) if value is not None else default
    except (ValueError, TypeError, IndexError):
        return default
    return number if np.isfinite(number) else default
