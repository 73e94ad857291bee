"""Materials by the parameters that mesh formats share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import Material

MATTE_ROUGHNESS = 0.9
"""glTF roughness from which a dielectric counts as diffuse, because its coat no longer shows."""
NEARLY = 1e-3
"""Distance from 0 or 1 below which metalness counts as exact, for converters' rounding."""
LEAST_IOR, MAX_IOR = 1.001, 4.0
"""Limits of the index of refraction; the upper one is the same as in `scene.toml`."""


def metal_or_not(
    albedo: tuple[float, float, float],
    metallic: float,
    roughness: float,
    texture: NDArray[np.float32] | None,
    surface: NDArray[np.float32] | None = None,
    ior: float = Material.ior,
) -> Material:
    """Return the simplest material of glTF's parameters (glTF 2.0, section 3.9.2).

    It is plastic without metalness and maps of it, and diffuse if that is rough or reflects
    nothing.
    """
    metallic, alpha = float(np.clip(metallic, 0.0, 1.0)), plain_alpha(roughness)
    if surface is not None or metallic > NEARLY:
        metallic = 1.0 if metallic > 1.0 - NEARLY else metallic
        return Material(
            "principled",
            albedo,
            alpha=alpha,
            ior=ior,
            texture=texture,
            metallic=metallic,
            surface_texture=surface,
        )
    if alpha >= MATTE_ROUGHNESS**2 or ior <= LEAST_IOR:
        return Material("diffuse", albedo, texture=texture)
    return Material("plastic", albedo, alpha=alpha, ior=ior, texture=texture)


def plain_alpha(roughness: float) -> float:
    """Return the alpha of glTF's roughness."""
    return float(np.clip(roughness, 0.0, 1.0)) ** 2


def triple(values: Any, most: float) -> tuple[float, float, float]:
    """Return three numbers in [0, most]."""
    try:
        given = np.asarray(values, np.float64)
    except (ValueError, TypeError):
        given = np.zeros(3)
    r, g, b = np.clip(np.nan_to_num(np.resize(given, 3)), 0.0, most)
    return float(r), float(g), float(b)


def color_of(values: Any) -> tuple[float, float, float]:
    """Return an RGB color; MTL may give one value for all channels, or no numbers (black)."""
    return triple(values, 1.0)
