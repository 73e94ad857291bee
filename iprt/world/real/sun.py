"""The sun of a frame for kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from iprt.device.block import Block, Float4, when
from iprt.device.vectors import float4
from iprt.footage.sun import Sun


@dataclass(kw_only=True)
class SunArgs(Block):
    """A sun that the panorama does not show (`cl/lib/world/real/sun.h`).

    Attributes
    ----------
    disc : float4 or None
        Direction, and the squared sine of the radius.
    radiance : float4 or None
        Its radiance, and the inverse of its solid angle in sr.
    """

    disc: Float4 = when("SUN")
    radiance: Float4 = when("SUN")

    @classmethod
    def of(cls, sun: Sun | None, pose: NDArray[np.float64] | None) -> Self:
        """Return the arguments of a sun, for a capture centre with a (4, 4) pose; None: no pose."""
        if sun is None:
            return cls()
        direction = sun.direction if pose is None else pose[:3, :3].T @ sun.direction
        x, y, z = direction.tolist()
        return cls(
            disc=float4((x, y, z, sun.sine_squared)),
            radiance=float4((*sun.radiance, 1.0 / sun.solid_angle)),
        )
