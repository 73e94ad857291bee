"""One frame of 360° RGBD video, sanitised."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.median import median_of_smallest
from iprt.footage.normals import estimate_normals, fit_tolerance, sanitise_normals
from iprt.geometry.material import Material

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear Rec.709, in which all colour is."""


@dataclass(frozen=True)
class Frame:
    """A panorama in the convention of the scene format.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance that surfaces send, finite, non-negative.
    depth : (H, W) float32
        Metres from the capture centre; positive; +inf where the sky is open (no rim closes it).
        Openings hold a depth interpolated from their rim.
    opening : (H, W) bool
        True where the source has no depth and a rim does: windows, mostly.
    normal : (H, W, 3) float32 or None
        World-space normals as the source has them: of any length, of either side, and none where
        they are not finite or (nearly) zero. Where there is none, they are fitted to depth: by the
        device, or by `fitted_normal`. None: there is none anywhere.
    gloss : (H, W) uint8 or None
        0 where the surface is diffuse, else 1 + its index in `real_materials`. None: nowhere.
    real_materials : tuple of Material
        The glossy materials of the real scene.
    index : int
        Number of the frame in the video.
    pose : (4, 4) float64 or None
        Rigid transform from this frame's capture centre and axes, in which all above is, to the
        world. None: they are the world's.
    clipped : ClippedTexels or None
        Texels that the picture shows clipped. None: it shows `color`.
    color_map : (3, 3) float64 or None
        Takes colours of this frame to those of the video's reference frame, which was exposed and
        balanced otherwise. None: they are the same.
    """

    color: NDArray[np.float32]
    depth: NDArray[np.float32]
    opening: NDArray[np.bool_]
    normal: NDArray[np.float32] | None = None
    gloss: NDArray[np.uint8] | None = None
    real_materials: tuple[Material, ...] = ()
    index: int = 0
    pose: NDArray[np.float64] | None = None
    clipped: ClippedTexels | None = None
    color_map: NDArray[np.float64] | None = None

    @cached_property
    def radiance(self) -> NDArray[np.float32]:
        """(H, W, 3) linear radiance that rays find: `color`, as the reference frame shows it."""
        return self.radiance_of(self.color)

    @property
    def picture(self) -> NDArray[np.float32]:
        """(H, W, 3) linear radiance as the camera saw it; not kept where lights are clipped."""
        return self.color if self.clipped is None else self.clipped.shown(self.color)

    def radiance_of(self, color: NDArray[np.float32]) -> NDArray[np.float32]:
        """`radiance` of texels of `color`, (..., 3)."""
        if self.color_map is None:
            return color
        mapped = color @ self.color_map.T.astype(np.float32)
        return np.maximum(mapped, np.float32(0.0))

    @cached_property
    def fitted_normal(self) -> NDArray[np.float32]:
        """(H, W, 3) unit normals that face the capture centre; zero where depth is infinite.

        Those of the source, or fitted to depth. Fitting takes the host long; the device has its own
        (`cl/world/real/planes.cl`).
        """
        fitted = estimate_normals(self.depth, self.opening.view(np.uint8))
        return fitted if self.normal is None else sanitise_normals(self.normal, fitted)

    def fitted_normal_in(self, rows: slice) -> NDArray[np.float32]:
        """Return these rows of `fitted_normal`, and fit no others if it can."""
        if self.normal is not None or "fitted_normal" in vars(self):
            return self.fitted_normal[rows]
        return estimate_normals(self.depth, self.opening.view(np.uint8), rows)

    def measured(self) -> Self:
        """The same, once what takes time to find out about its depth is known."""
        _ = self.median_depth, self.nearest, self.farthest, self.fit_tolerance
        return self

    @property
    def height(self) -> int:
        return int(self.depth.shape[0])

    @property
    def width(self) -> int:
        return int(self.depth.shape[1])

    @cached_property
    def nearest(self) -> float:
        """The smallest finite depth, in metres; 0 where all is open sky."""
        least = float(self.depth.min())
        return least if np.isfinite(least) else 0.0

    @cached_property
    def farthest(self) -> float:
        """The largest finite depth, in metres; 0 where all is open sky."""
        most = float(self.depth.max())
        if np.isfinite(most):
            return most
        return float(self.depth.max(initial=0.0, where=np.isfinite(self.depth)))

    @cached_property
    def median_depth(self) -> float:
        """Median of the finite depths, in metres: the unit of the tracer's tolerances."""
        finite = int(np.count_nonzero(np.isfinite(self.depth)))
        return median_of_smallest(self.depth, finite) if finite else 1.0

    @cached_property
    def fit_tolerance(self) -> float:
        """How far what is on one plane may be off it, as a fraction of the depth."""
        return fit_tolerance(self.depth)
