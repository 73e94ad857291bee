"""Visible surfaces of a panorama as one triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View

Ints = NDArray[np.int64]

STEP = 0.03
"""Depth step beyond the tangent plane's prediction that counts as a gap, relative to the depth."""
CREASE = 3.0
"""The same in units of a texel's angle: at a room's edge neither plane predicts the other."""


@dataclass(frozen=True)
class DepthMesh:
    """Triangles between neighbouring texels that lie on one surface.

    Attributes
    ----------
    positions : (H * W + 2, 3) float64
        World space; texel (row, column) is vertex `row * W + column`, the poles come last.
    triangles : (F, 3) int64
        Counter-clockwise seen from the capture centre.
    """

    positions: NDArray[np.float64]
    triangles: Ints


def depth_mesh(frame: Frame) -> DepthMesh:
    """Connect the texel centres of a frame, leaving gaps where the depth jumps.

    Two texels are connected if either lies near the other's tangent plane (`STEP`, `CREASE`).
    Texels without depth have no triangles. Each pole is closed by a fan to its row's mean inverse
    depth.
    """
    height, width = frame.height, frame.width
    texels = _Texels(frame)
    finite, depth = (plane.reshape(height, width) for plane in (texels.finite, texels.depth))
    index = np.arange(height * width).reshape(height, width)
    east = np.roll(index, -1, axis=1)
    nw, ne, sw, se = index[:-1], east[:-1], index[1:], east[1:]
    to_east, to_south = texels.joined(index, east), texels.joined(nw, sw)
    # Each quad is cut along the diagonal whose ends fit each other better.
    falls = (texels.misfit(nw, se) <= texels.misfit(ne, sw)) & texels.joined(nw, se)
    rises = ~falls & texels.joined(ne, sw)
    north, south = to_east[:-1], to_east[1:]
    west, right = to_south, np.roll(to_south, -1, axis=1)
    triangles = [
        np.stack([a, b, c], axis=-1)[keep]
        for a, b, c, keep in (
            (nw, sw, se, falls & west & south),
            (nw, se, ne, falls & north & right),
            (nw, sw, ne, rises & north & west),
            (ne, sw, se, rises & south & right),
        )
    ]
    zenith, nadir = height * width, height * width + 1
    caps = []
    for pole, row, start, stop in ((zenith, 0, index, east), (nadir, height - 1, east, index)):
        keep = to_east[row] & finite[row]
        fan = np.stack([start[row], stop[row], np.full(width, pole)], axis=-1)
        triangles.append(fan[keep])
        height_m = 1.0 / np.mean(1.0 / depth[row][finite[row]]) if finite[row].any() else 1.0
        caps.append((0.0, height_m if pole == zenith else -height_m, 0.0))
    positions = texels.directions * texels.depth[:, None]
    return DepthMesh(np.vstack([positions, caps]), np.concatenate(triangles))


class _Texels:
    """Texels of a frame by row-major index; depth is 1 where there is none."""

    def __init__(self, frame: Frame) -> None:
        view = View(frame.width, frame.height, projection="equirect")
        self.directions = view.directions().reshape(-1, 3)
        self.finite = np.isfinite(frame.depth).ravel()
        self.depth = np.where(self.finite, frame.depth.ravel(), 1.0).astype(np.float64)
        self._normal = frame.fitted_normal.reshape(-1, 3).astype(np.float64)
        self._step = max(STEP, CREASE * np.pi / frame.height)

    def joined(self, a: Ints, b: Ints) -> NDArray[np.bool_]:
        """Return whether pairs of texels lie on one surface."""
        return self.finite[a] & self.finite[b] & (self.misfit(a, b) <= self._step)

    def misfit(self, a: Ints, b: Ints) -> NDArray[np.float64]:
        """Return the relative distance of one of two texels from the other's tangent plane."""
        return np.minimum(self._off(a, b), self._off(b, a))

    def _off(self, here: Ints, there: Ints) -> NDArray[np.float64]:
        n, depth = self._normal[here], self.depth
        across = np.sum(n * self.directions[there], axis=-1)
        along = np.sum(n * self.directions[here], axis=-1)
        # Planes seen from behind or edge-on predict nothing: infinite distance.
        fits = np.minimum(across, along) < -1e-3
        level = along / np.where(fits, across, 1.0)
        predicted = np.where(fits & (along < 0), depth[here] * level, np.inf)
        return np.abs(predicted - depth[there]) / np.minimum(depth[here], depth[there])
