"""Materials of virtual objects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

MaterialKind = Literal["diffuse", "conductor", "plastic"]
MIRROR_ALPHA = 1e-4
"""GGX roughness below which a surface is a perfect mirror."""


@dataclass(frozen=True)
class Material:
    """Reflectance of a surface; linear Rec.709.

    Attributes
    ----------
    kind : {"diffuse", "conductor", "plastic"}
        Lambertian; GGX with a constant (Fresnel-free) reflectance; GGX dielectric coat over a
        Lambertian base.
    albedo : (r, g, b)
        Diffuse albedo in [0, 1], or the conductor's reflectance. Multiplies the texture.
    alpha : float
        GGX roughness of the conductor or the coat; a mirror at 0.
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
        return self.kind == "conductor" and self.alpha < MIRROR_ALPHA
