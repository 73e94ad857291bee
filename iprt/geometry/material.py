"""Materials of virtual objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from iprt.device.kept import Arrays, kept
from iprt.device.kernel_source import constant
from iprt.geometry.coat import internal_reflectance, rough_transmittance

MaterialKind = Literal["diffuse", "conductor", "plastic"]
MIRROR_ALPHA = 1e-4
"""GGX roughness below which a surface is a perfect mirror."""
MIN_ALPHA = 1e-3
"""Least GGX roughness of other surfaces; single precision cannot resolve a narrower lobe."""
_BRDF = "lib/world/brdf.h"
MATERIAL_ROWS = constant(_BRDF, "MATERIAL_ROWS")
"""float4 rows per material in the table; `cl/lib/world/brdf.h` documents them."""
_NODES = constant(_BRDF, "MATERIAL_NODES")
_KINDS = {kind: constant(_BRDF, f"KIND_{kind.upper()}") for kind in get_args(MaterialKind)}

DIFFUSE_KINDS = frozenset(("diffuse", "plastic"))
SPECULAR_KINDS = frozenset(("conductor", "mirror", "plastic"))
"""Kinds of reflectance with a diffuse or a specular lobe; a mirror has no roughness."""


@dataclass(frozen=True)
class Material:
    """The reflectance of a surface, in linear Rec.709.

    Attributes
    ----------
    kind : {"diffuse", "conductor", "plastic"}
        Lambertian; GGX with constant reflectance (no Fresnel term); or a GGX dielectric coat over a
        Lambertian base.
    albedo : (r, g, b)
        Diffuse albedo in [0, 1], or the conductor's reflectance. It multiplies the texture.
    alpha : float
        GGX roughness of the conductor or the coat; 0 for a mirror.
    ior : float
        Index of refraction of the coat.
    texture : (H, W, 3) float32 or None
        Linear albedo image, row 0 at v = 1, repeated outside [0, 1].
    """

    kind: MaterialKind = "diffuse"
    albedo: tuple[float, float, float] = (0.5, 0.5, 0.5)
    alpha: float = 0.1
    ior: float = 1.5
    texture: NDArray[np.float32] | None = field(default=None, compare=False)

    @property
    def is_mirror(self) -> bool:
        """True for a perfect mirror."""
        return self.kind == "conductor" and self.alpha < MIRROR_ALPHA


def material_table(materials: Sequence[Material]) -> NDArray[np.float32]:
    """Return the table of materials that kernels read; albedo comes with each hit instead.

    Returns
    -------
    (MATERIAL_ROWS * len(materials), 4) float32
        Per material: kind, alpha (0 or at least `MIN_ALPHA`), index of refraction, scale factor of
        the base below a coat; then the coat's transmittance at cosines (i / 31)², i = 0..31.
    """
    rows = np.zeros((len(materials), MATERIAL_ROWS, 4), np.float32)
    for row, material in zip(rows, materials, strict=True):
        alpha = 0.0 if material.alpha < MIRROR_ALPHA else max(material.alpha, MIN_ALPHA)
        row[0, :3] = _KINDS[material.kind], alpha, material.ior
        if material.kind == "plastic":
            coat = _coat(alpha, material.ior)
            row[0, 3], row[1:] = coat["base"], coat["transmittance"]
    return rows.reshape(-1, 4)


@lru_cache(maxsize=256)
def _coat(alpha: float, ior: float) -> Arrays:
    """Return a coat's part of the table, which is kept: its integrals take long."""

    def make() -> Arrays:
        cosine = np.linspace(0, 1, _NODES) ** 2
        escaping = 1 - internal_reflectance(alpha, ior)
        transmittance = rough_transmittance(cosine, alpha, ior).astype(np.float32)
        return {
            "base": np.array(1 / (ior**2 * escaping)),
            "transmittance": transmittance.reshape(-1, 4),
        }

    return kept("coat", __name__, [alpha, ior], make)
