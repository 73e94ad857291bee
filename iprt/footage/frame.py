"""Prepared frames of 360° RGBD video."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.depth_noise import fit_tolerance
from iprt.footage.median import median_of_smallest
from iprt.footage.normals import estimate_normals, estimate_normals_at, sanitize_normals
from iprt.footage.sky import Sky
from iprt.footage.sun import Sun
from iprt.geometry.material import Material

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of luminance in linear Rec.709, the color space of all frames."""
OF_DEPTH = ("median_depth", "nearest", "farthest", "fit_tolerance")
"""Properties of a frame that depend on its depth alone."""


@dataclass(frozen=True)
class Frame:
    """A panorama in the convention of the scene format.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance of surfaces, finite, non-negative.
    depth : (H, W) float32
        Metres from the capture centre; positive; +inf in open sky (no rim closes it). Openings
        hold a depth interpolated from their rim.
    opening : (H, W) bool
        Where the source has no depth inside a closed rim: mostly windows.
    normal : (H, W, 3) float32 or None
        World-space normals as in the source: of any length, on either side, and missing where they
        are not finite or (nearly) zero. Missing normals are fitted to depth, by the device or by
        `fitted_normal`. None: all are missing.
    gloss : (H, W) uint8 or None
        0 on diffuse surfaces, else 1 + the index in `real_materials`. None: all are diffuse.
    real_materials : tuple of Material
        The glossy materials of the real scene.
    sun : Sun or None
        A distant light that the panorama need not show.
    sky : Sky or None
        Radiance behind windows where no camera saw it, in the axes of the frame. None: as
        extrapolated.
    index : int
        Index of the frame in the video.
    pose : (4, 4) float64 or None
        Rigid transform from this frame's capture centre and axes, which all of the above uses, to
        the world. None: identity.
    clipped : ClippedTexels or None
        Colors of clipped texels as stored in the picture. None: nothing is clipped.
    color_map : (3, 3) float64 or None
        Map from colors of this frame to colors of the video's reference frame, which differs in
        exposure and white balance. None: identity.
    """

    color: NDArray[np.float32]
    depth: NDArray[np.float32]
    opening: NDArray[np.bool_]
    normal: NDArray[np.float32] | None = None
    gloss: NDArray[np.uint8] | None = None
    real_materials: tuple[Material, ...] = ()
    sun: Sun | None = None
    sky: Sky | None = None
    index: int = 0
    pose: NDArray[np.float64] | None = None
    clipped: ClippedTexels | None = None
    color_map: NDArray[np.float64] | None = None

    @cached_property
    def radiance(self) -> NDArray[np.float32]:
        """Linear radiance (H, W, 3) for rays: `color` in the colors of the reference frame."""
        return self.radiance_of(self.color)

    @property
    def picture(self) -> NDArray[np.float32]:
        """Linear radiance (H, W, 3) as the camera stored it; not cached if lights are clipped."""
        return self.color if self.clipped is None else self.clipped.shown(self.color)

    def radiance_of(self, color: NDArray[np.float32]) -> NDArray[np.float32]:
        """Map texels (..., 3) of `color` to `radiance`."""
        if self.color_map is None:
            return color
        mapped = color @ self.color_map.T.astype(np.float32)
        return np.maximum(mapped, np.float32(0.0))

    @cached_property
    def fitted_normal(self) -> NDArray[np.float32]:
        """Unit normals (H, W, 3) that face the capture centre; zero where depth is infinite.

        They come from the source, or are fitted to depth. Fitting takes long on the host; the
        device fits its own (`cl/world/real/planes.cl`).
        """
        fitted = estimate_normals(self.depth, self.opening.view(np.uint8), self.fit_tolerance)
        return fitted if self.normal is None else sanitize_normals(self.normal, fitted)

    def fitted_normal_at(self, texel: NDArray[np.intp]) -> NDArray[np.float32]:
        """Return `fitted_normal` (N, 3) of flat indices; fit no others if possible."""
        if self.normal is not None or "fitted_normal" in vars(self):
            return self.fitted_normal.reshape(-1, 3)[texel]
        same = self.opening.view(np.uint8)
        return estimate_normals_at(texel, self.depth, same, self.fit_tolerance)

    def recolored(self, **parts: Any) -> Self:
        """Return the frame with other parts, none of which is depth, whose properties it keeps."""
        other = replace(self, **parts)
        kept = {name: value for name, value in vars(self).items() if name in OF_DEPTH}
        vars(other).update(kept)
        return other

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.depth.shape[0])

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.depth.shape[1])

    @cached_property
    def nearest(self) -> float:
        """Smallest finite depth, in metres; 0 if all is open sky."""
        least = float(self.depth.min())
        return least if np.isfinite(least) else 0.0

    @cached_property
    def farthest(self) -> float:
        """Largest finite depth, in metres; 0 if all is open sky."""
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
        """Largest distance of points on one plane from it, relative to depth."""
        return fit_tolerance(self.depth)
