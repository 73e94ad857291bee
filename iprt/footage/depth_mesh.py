"""Visible surfaces of a panorama as one triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.equirect import texel_directions

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
    positions : (h * w + 2, 3) float64
        In the axes of the frame; vertex `i * w + j` is texel (`rows[i]`, `columns[j]`), the poles
        come last.
    triangles : (F, 3) int64
        Counter-clockwise seen from the capture centre.
    rows : (h,) int64
    columns : (w,) int64
        Texels of the frame whose centres are vertices.
    """

    positions: NDArray[np.float64]
    triangles: Ints
    rows: Ints
    columns: Ints


def depth_mesh(frame: Frame, size: tuple[int, int] | None = None) -> DepthMesh:
    """Connect the texel centres of a frame, leaving gaps where the depth jumps.

    Two texels are connected if either lies near the other's tangent plane (`STEP`, `CREASE`).
    Texels without depth have no triangles. Each pole is closed by a fan to its row's mean inverse
    depth.

    Parameters
    ----------
    size : (width, height) or None
        Largest number of columns and rows, of which a regular selection is used; None: all.
    """
    width, height = (frame.width, frame.height) if size is None else size
    rows, columns = _selected(frame.height, height), _selected(frame.width, width)
    height, width = len(rows), len(columns)
    texels = _Texels(frame, rows, columns)
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
    return DepthMesh(np.vstack([positions, caps]), np.concatenate(triangles), rows, columns)


def _selected(there: int, most: int) -> Ints:
    """Return at most `most` of the numbers from 0 to `there` - 1, evenly spaced."""
    count = min(there, most)
    return np.asarray((np.arange(count) + 0.5) * there / count, np.int64)


class _Texels:
    """Selected texels of a frame by row-major index; depth is 1 where there is none."""

    def __init__(self, frame: Frame, rows: Ints, columns: Ints) -> None:
        x, y, z = texel_directions(frame.width, frame.height)
        self.directions = np.stack(np.broadcast_arrays(x, y, z), axis=-1)[rows][:, columns]
        self.directions = self.directions.reshape(-1, 3)
        depth = frame.depth[np.ix_(rows, columns)].ravel()
        self.finite = np.isfinite(depth)
        self.depth = np.where(self.finite, depth, 1.0).astype(np.float64)
        texel = (rows[:, None] * frame.width + columns).ravel()
        whole = len(texel) == frame.depth.size
        normal = frame.fitted_normal.reshape(-1, 3) if whole else frame.fitted_normal_at(texel)
        self._normal = normal.astype(np.float64)
        self._step = max(STEP, CREASE * np.pi / len(rows))

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
