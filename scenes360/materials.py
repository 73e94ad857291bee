"""Mitsuba BSDFs of the models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from iprt.truth.backend import mitsuba
from scenes360.textures import Image

Bsdf = dict[str, Any]


def diffuse(*rgb: float) -> Bsdf:
    """Return a diffuse BSDF of linear RGB reflectance."""
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(rgb)}}


def textured(image: Image) -> Bsdf:
    """Return a diffuse BSDF with a texture."""
    return {"type": "diffuse", "reflectance": bitmap(image)}


def glossy(reflectance: Any, alpha: float) -> Bsdf:
    """Return a plastic BSDF with a rough coat."""
    if isinstance(reflectance, tuple):
        reflectance = {"type": "rgb", "value": list(reflectance)}
    return {
        "type": "roughplastic",
        "distribution": "ggx",
        "int_ior": 1.5,
        "alpha": alpha,
        "diffuse_reflectance": reflectance,
    }


def metal(rgb: Sequence[float], alpha: float) -> Bsdf:
    """Return a rough conductor of this specular reflectance."""
    return {
        "type": "roughconductor",
        "distribution": "ggx",
        "material": "none",
        "alpha": alpha,
        "specular_reflectance": {"type": "rgb", "value": list(rgb)},
    }


def bitmap(image: Image) -> Bsdf:
    """Return a bitmap texture of a linear image."""
    mi = mitsuba()
    return {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(image)), "raw": True}


def both_sides(bsdf: Bsdf) -> Bsdf:
    """Return a two-sided BSDF."""
    return {"type": "twosided", "bsdf": bsdf}
