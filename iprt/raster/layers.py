"""The layers of rasterized objects, which tracing and shading read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SAMPLES = 4
"""Coverage takes SAMPLES x SAMPLES sub-samples per pixel."""

COVERAGE_TOLERANCE = 0.005
"""An object is in front of the real surface up to this fraction of the distance behind it: noise
in measured depth must not eat an object's foot."""

NO_MOTION = -1e9
"""Both motion components where there is no surface."""


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
    hide nothing here: what they hide still casts shadows.

    Attributes
    ----------
    coverage : (H, W) float32 or None
        Fraction of the pixel in which an object is in front of the real surface (1 - M of IPRT
        Eq. 2). Where it is positive, `front` holds a surface, borrowed from a neighbour if the
        pixel's own centre misses it; there, and only there, `front` has a surface and `back` has
        none, so that tracing skips these pixels and objects do not grow. Slivers without a
        neighbour to borrow from count as 0. None for layers that are only traced.
    motion : (H, W, 2) float32 or None
        Where the front surface was in the previous frame's picture, in pixels; (-1e9, -1e9)
        where there is none.
    """

    front: Layer
    back: Layer
    coverage: NDArray[np.float32] | None = None
    motion: NDArray[np.float32] | None = None
