"""Layers of the rasterized objects, the input of tracing and shading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.device.kernel_source import float_constant

SAMPLES = 4
"""Default number of coverage samples along each side of a pixel."""

COVERAGE_TOLERANCE = float_constant("lib/gbuffer/view.h", "COVERAGE_TOLERANCE")

NO_MOTION = -1e9
"""Both components of motion vectors where there is no surface."""


def blank_display(images: int, height: int, width: int) -> NDArray[np.float32]:
    """Return `ObjectLayers.display` for a picture without objects."""
    display = np.zeros((images, height, width, 4), np.float32)
    display[2, ..., 1:3] = NO_MOTION
    return display


@dataclass(frozen=True)
class Layer:
    """One depth layer of the virtual objects, seen from the capture centre.

    Attributes
    ----------
    geometry : (H, W, 4) float32
        World-space unit shading normal (outward, as in the mesh) and radial distance in metres; all
        0 where there is no surface.
    material : (H, W, 4) float32
        Albedo (texture applied), and 1 + the index of the material in `Rasterizer.materials`; all 0
        where there is no surface.
    """

    geometry: NDArray[np.float32]
    material: NDArray[np.float32]


@dataclass(frozen=True)
class ObjectLayers:
    """The first solid interval behind each pixel centre, with coverage and motion vectors.

    `front` is the nearest surface of either orientation. `back` is the nearest back-facing surface
    at or beyond it, so that [front, back] is the first solid interval of a closed mesh; it is None
    if not requested. Real surfaces do not occlude the layers, because hidden parts still cast
    shadows.

    Attributes
    ----------
    display : (3 to 5, H, W, 4) float32 or None
        The arrays of `front`; (coverage, motion x, motion y, fraction of the pixel covered by
        objects, occluded or not); with principled or emitting materials (metalness, alpha, 0, 0);
        with emitting ones (emitted radiance, 0). None for layers that are only traced.
    coverage : (H, W) float32 or None
        Fraction of the pixel in which an object is in front of the real surface (1 - M of IPRT Eq.
        2). Every pixel touched by an object has a surface in `front`, borrowed from a neighbour if
        the pixel's own centre misses the object. A borrowed surface, and no other, has a `front`
        without a `back`: tracing skips these pixels, so that objects do not grow. Slivers without a
        neighbour to borrow from count as 0.
    motion : (H, W, 2) float32 or None
        Pixel position of the front surface in the previous frame; (-1e9, -1e9) where there is no
        surface.
    """

    front: Layer
    back: Layer | None
    display: NDArray[np.float32] | None = None

    @classmethod
    def displayed(cls, display: NDArray[np.float32], back: Layer | None) -> ObjectLayers:
        """Build layers for display from `display` and the back layer."""
        return cls(Layer(display[0], display[1]), back, display)

    @property
    def coverage(self) -> NDArray[np.float32] | None:
        """Fraction of each pixel in which an object is in front of the real surface, (H, W)."""
        return None if self.display is None else self.display[2, ..., 0]

    @property
    def motion(self) -> NDArray[np.float32] | None:
        """Previous pixel position of the front surface, (H, W, 2)."""
        return None if self.display is None else self.display[2, ..., 1:3]
