"""Materials of mesh files to the three kinds that are rendered."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.scene.images import decode_srgb, texture_pixels
from iprt.scene.material import Material
from iprt.scene.untrusted import MAX_PIXELS

DEFAULT_MATERIAL = Material("diffuse", (0.5, 0.5, 0.5))
MATTE_ROUGHNESS = 0.9
"""glTF roughness from which a dielectric is taken as diffuse: its coat no longer shows."""
GLOSSY_SPECULAR = 0.04
"""Least specular reflectance (Ks) of an MTL material that gets a coat."""


class Textures:
    """Decoded textures of one mesh file, each once however many materials have it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._texels = 0
        self._decoded: dict[bytes, NDArray[np.float32]] = {}

    def linear(self, image: Any) -> NDArray[np.float32] | None:
        """Linear (H, W, 3) float32 of a picture that Pillow has opened; None if it is none.

        Raises
        ------
        FormatError
            Damaged, of a format that is not read, or too many texels with those before.
        """
        if not isinstance(image, Image.Image):
            return None
        pixels = texture_pixels(image, self._path)
        digest = hashlib.blake2b(pixels.tobytes() + str(pixels.shape).encode()).digest()
        if digest not in self._decoded:
            self._texels += pixels.shape[0] * pixels.shape[1]
            if self._texels > MAX_PIXELS:
                raise FormatError(
                    f"{self._path}: its textures have more than the {MAX_PIXELS} pixels that are "
                    "read; make them smaller"
                )
            self._decoded[digest] = decode_srgb(pixels)
        return self._decoded[digest]


def convert_material(
    source: Any, factors: dict[str, list[float]], textures: Textures, dropped: list[str]
) -> Material:
    """A trimesh material as one of ours; what is lost is appended to `dropped`.

    Parameters
    ----------
    source : trimesh material or None
        PBRMaterial (glTF) or SimpleMaterial (MTL).
    factors : dict of str to list of float
        Base colours of a glTF file by the material's name: trimesh keeps only 8 bits of them.
    textures : Textures
    dropped : list of str
    """
    if source is None:
        return DEFAULT_MATERIAL
    if type(source).__name__ == "PBRMaterial":
        return _from_pbr(source, factors, textures, dropped)
    return _from_mtl(source, textures, dropped)


def _from_pbr(
    source: Any, factors: dict[str, list[float]], textures: Textures, dropped: list[str]
) -> Material:
    """glTF 2.0, section 3.9.2: metallic from 0.5 on is a conductor; alpha = roughness²."""
    _note_unused_maps(source, dropped)
    color = factors.get(source.name)
    if color is None:
        stored = source.baseColorFactor
        color = [1.0, 1.0, 1.0] if stored is None else [float(c) / 255.0 for c in stored]
    albedo = _color(color)
    texture = textures.linear(source.baseColorTexture)
    metallic = 1.0 if source.metallicFactor is None else float(source.metallicFactor)
    roughness = 1.0 if source.roughnessFactor is None else float(source.roughnessFactor)
    alpha = float(np.clip(roughness, 0.0, 1.0) ** 2)
    # A map scales the factor: without it, a factor of 1 says nothing about the material.
    if metallic >= 0.5 and source.metallicRoughnessTexture is None:
        return Material("conductor", albedo, alpha=alpha, texture=texture)
    if roughness >= MATTE_ROUGHNESS:
        return Material("diffuse", albedo, texture=texture)
    return Material("plastic", albedo, alpha=alpha, texture=texture)


def _from_mtl(source: Any, textures: Textures, dropped: list[str]) -> Material:
    """MTL: diffuse (Kd), with a coat where Ks and the exponent Ns say that it shines.

    A Phong exponent n is about as wide as GGX with alpha = sqrt(2 / (n + 2)) (Walter et al.,
    "Microfacet Models for Refraction", 2007, section 5.2, for Beckmann).
    """
    values = source.kwargs
    albedo = _color(values.get("kd", [1.0, 1.0, 1.0]))
    texture = textures.linear(source.image)
    if _first(values.get("d"), 1.0) < 1.0 or _first(values.get("tr"), 0.0) > 0.0:
        dropped.append("transparency")
    dropped.extend(f"texture {key}" for key in sorted(values) if _is_map(key))
    specular = max(_color(values.get("ks", [0.0, 0.0, 0.0])))
    exponent = _first(values.get("ns"), 0.0)
    if specular >= GLOSSY_SPECULAR and exponent >= 1.0:
        alpha = float(np.sqrt(2.0 / (exponent + 2.0)))
        return Material("plastic", albedo, alpha=alpha, texture=texture)
    return Material("diffuse", albedo, texture=texture)


def _note_unused_maps(source: Any, dropped: list[str]) -> None:
    for key, phrase in (
        ("normalTexture", "normal map"),
        ("occlusionTexture", "occlusion map"),
        ("metallicRoughnessTexture", "metallic-roughness map"),
        ("emissiveTexture", "emission map"),
    ):
        if getattr(source, key) is not None:
            dropped.append(phrase)
    emission = source.emissiveFactor
    if emission is not None and np.any(np.asarray(emission) > 0.0):
        dropped.append("emission")
    if source.alphaMode in ("MASK", "BLEND"):
        dropped.append("transparency")


def _is_map(key: str) -> bool:
    return (key.startswith("map_") and key != "map_kd") or key in ("bump", "norm", "disp", "refl")


def _color(values: Any) -> tuple[float, float, float]:
    r, g, b = np.clip(np.nan_to_num(np.asarray(values, np.float64)[:3]), 0.0, 1.0)
    return float(r), float(g), float(b)


def _first(value: Any, default: float) -> float:
    """MTL numbers arrive as a float or a list with one."""
    try:
        return float(np.ravel(value)[0]) if value is not None else default
    except (ValueError, TypeError, IndexError):
        return default
