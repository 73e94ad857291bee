"""The sun of a frame for kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from iprt.device.block import Block, Float4, Int32, when
from iprt.device.vectors import float4
from iprt.footage.frame import Frame
from iprt.footage.sun import is_outdoors


@dataclass(kw_only=True)
class SunArgs(Block):
    """A sun that the panorama does not show (`cl/lib/world/real/sun.h`).

    Attributes
    ----------
    disc : float4 or None
        Direction, and the squared sine of the radius.
    radiance : float4 or None
        Its radiance, and the inverse of its solid angle in sr.
    outdoors : int
        Rays that end behind surfaces leave to the sky, as behind a house; indoors they do not.
    """

    disc: Float4 = when("SUN")
    radiance: Float4 = when("SUN")
    outdoors: Int32 = when("SUN")

    @classmethod
    def of(cls, frame: Frame) -> Self:
        """Return the arguments of a frame's sun."""
        sun = frame.sun
        if sun is None:
            return cls()
        x, y, z = sun.seen_from(frame.pose).tolist()
        # In large panoramas, all texels would take long.
        sky = ~np.isfinite(frame.depth[::4, ::4])
        return cls(
            disc=float4((x, y, z, sun.sine_squared)),
            radiance=float4((*sun.radiance, 1.0 / sun.solid_angle)),
            outdoors=int(is_outdoors(sky)),
        )
