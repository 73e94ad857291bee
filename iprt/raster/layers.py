"""The layers of rasterized objects, which tracing and shading read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SAMPLES = 4
"""Coverage takes so many sub-samples a side of a pixel, unless other is asked for."""

COVERAGE_TOLERANCE = 0.005
"""An object is in front of the real surface up to this fraction of the distance behind it: noise
in measured depth must not eat an object's foot."""

NO_MOTION = -1e9
"""Both motion components where there is no surface."""


def blank_display(height: int, width: int) -> NDArray[np.float32]:
    """`ObjectLayers.display` without objects."""
    display = np.zeros((3, height, width, 4), np.float32)
    display[2, ..., 1:3] = NO_MOTION
    return display


@dataclass(frozen=True)
class Layer:
    """One depth layer of the virtual objects, seen from the capture centre.

    Attributes
    ----------
    geometry : (H, W, 4) float32
        World-space unit shading normal (outward, as the mesh has it) and the radial distance in
        metres; all 0 where there is no surface.
    material : (H, W, 4) float32
        Albedo (texture applied), and 1 + the index of the instance's material in
        `Rasterizer.materials`; all 0 where there is no surface.
    """

    geometry: NDArray[np.float32]
    material: NDArray[np.float32]


@dataclass(frozen=True)
class ObjectLayers:
    """The solid seen through each pixel centre: from its first surface to where the ray leaves it.

    `front` is the nearest surface of any orientation, `back` the nearest surface that faces away
    at or beyond it (so [front, back] is the first solid interval of a closed mesh). Real surfaces
    hide nothing here: what they hide still casts shadows. None: it was not asked for.

    Attributes
    ----------
    display : (3, H, W, 4) float32 or None
        The arrays of `front`, and (coverage, motion x, motion y, fraction of the pixel in which
        there is any object). None for layers that are only traced.
    coverage : (H, W) float32 or None
        Fraction of the pixel in which an object is in front of the real surface (1 - M of IPRT
        Eq. 2). Where there is any object, `front` holds a surface, borrowed from a neighbour if the
        pixel's own centre misses it; there, and only there, `front` has a surface and `back` has
        none, so that tracing skips these pixels and objects do not grow. Slivers without a
        neighbour to borrow from count as 0.
    motion : (H, W, 2) float32 or None
        Where the front surface was in the previous frame's picture, in pixels; (-1e9, -1e9)
        where there is none.
    """

    front: Layer
    back: Layer | None
    display: NDArray[np.float32] | None = None

    @classmethod
    def displayed(cls, display: NDArray[np.float32], back: Layer | None) -> ObjectLayers:
        """Layers of which the front is shown."""
        return cls(Layer(display[0], display[1]), back, display)

    @property
    def coverage(self) -> NDArray[np.float32] | None:
        return None if self.display is None else self.display[2, ..., 0]

    @property
    def motion(self) -> NDArray[np.float32] | None:
        return None if self.display is None else self.display[2, ..., 1:3]
