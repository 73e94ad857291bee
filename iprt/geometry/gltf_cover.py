"""Layers above glTF materials: KHR_materials_clearcoat and _sheen, and the tint of _specular."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from iprt.geometry.gltf_layers import index_of_refraction
from iprt.geometry.gltf_surfaces import GltfMaterial
from iprt.geometry.layers import FEWER_STRENGTHS, STRENGTHS, Layers, values_of, variants_of
from iprt.geometry.material import Material
from iprt.geometry.reflectance import plain_alpha
from iprt.geometry.sampler import Sampler


def covered(
    material: Material,
    source: GltfMaterial,
    base: tuple[float, float],
    layers: Layers,
    sampler: Sampler,
    dropped: list[str],
) -> Material:
    """Return a material below the clear coat and sheen of its source, with its tint, and maps.

    `dropped` gets phrases for approximations, and for layers that glass cannot have.

    Parameters
    ----------
    base : (float, float)
        Roughness and index of refraction, for a material without a coat of its own.
    layers : Layers
    sampler : Sampler
        Of the maps.
    """
    whole = replace(material, kind="principled")
    if material.kind in ("diffuse", "plastic"):
        roughness, ior = base
        whole = replace(whole, alpha=plain_alpha(roughness), ior=ior)
    tinted = material.kind != "diffuse" and (
        material.metallic < 1.0 or material.maps[1] is not None
    )
    index = partial(index_of_refraction, source)
    mean = values_of(layers.mean, 0, index)
    whole = replace(whole, **_layers(mean, tinted=tinted))
    if material.kind == "dielectric":
        dropped += [name for name, given in _names(whole, layers).items() if given]
        return material
    strengths = STRENGTHS if whole.maps[1] is None else FEWER_STRENGTHS
    variants = variants_of(layers, index, sampler, tinted=tinted, strengths=strengths)
    whole = replace(whole, variants=variants)
    return whole if whole.is_covered or variants is not None else material


def _names(whole: Material, layers: Layers) -> dict[str, bool]:
    return {
        "clearcoat of glass": whole.clearcoat > 0.0,
        "sheen of glass": max(whole.sheen) > 0.0,
        "color of the specular reflection of glass": min(whole.tint) < 1.0,
        "map of specular strength of glass; its mean is used": bool(
            np.ptp(layers.specular, axis=0).any()
        ),
    }


def _layers(values: dict[str, Any], *, tinted: bool) -> dict[str, Any]:
    """Return the values of layers alone."""
    return {
        name: value
        for name, value in values.items()
        if name not in ("ior", "transmission") and (tinted or name != "tint")
    }
