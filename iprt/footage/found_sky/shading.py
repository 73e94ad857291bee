"""Shading of a room's surfaces by seen and unseen light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.albedo_segments import points_of_segments, segments, spread_cells, well_seen
from iprt.footage.cell_rays import leaves
from iprt.footage.cells import Cells, Float, cell_means
from iprt.footage.found_sun.receivers import spoilt
from iprt.footage.frame import Frame
from iprt.footage.received_light import RoomLight, finer
from iprt.footage.sky import OUTSIDE_ROWS, node_weights
from iprt.footage.window_environment import outside_radiance, seen_share
from iprt.geometry.camera import View

RECEIVER_ROWS = 128
"""Rows of cells of receivers."""
CANDIDATES = 1000
"""Cells, spread over the sphere, that are candidates for receivers."""
SUN_STEPS, SUN_LIFT = 200, 0.005
"""Points of a ray to the sun, and offset of its origin, relative to depth."""
LEAST_DIFFUSE = 0.6
"""Least diffuse share of the radiance of glossy receivers."""
DARK = 1e-3
"""Radiance relative to the median below which noise corrupts a logarithm."""
MIN_RECEIVERS = 20
MIN_UNSEEN = 0.02
"""Least mean share of light from unseen directions in all that receivers get."""


@dataclass(frozen=True)
class Shading:
    """Radiance of n points in S segments of equal reflectance, and their irradiance.

    Attributes
    ----------
    radiance : (n, 3) float64
        Diffuse radiance.
    segment : (n,) int
        Segment of each point, from 0 to S - 1; none is empty.
    known : (n, 3) float64
        Irradiance by all that the panorama shows.
    unseen : (n, M, 3) float64
        Irradiance through windows from directions that no camera saw, as extrapolated, by nodes of
        a `Sky`.
    shown : (D, 3) float64
        Directions that windows show, in the axes of the world.
    """

    radiance: Float
    segment: NDArray[np.intp]
    known: Float
    unseen: Float
    shown: Float

    @classmethod
    def of(cls, frame: Frame, room: RoomLight, sun: Float | None) -> Shading | None:
        """Compute the shading of a frame; None if too little of it comes from unseen directions.

        Parameters
        ----------
        frame : Frame
            With windows.
        room : RoomLight
            Its surfaces.
        sun : (3,) float64 or None
            Direction of a sun in the axes of the frame; sunlit cells are left out.
        """
        cells = Cells.of(room.shown, RECEIVER_ROWS)
        color, usable = _receivers(frame, cells, room, sun)
        candidates = spread_cells(RECEIVER_ROWS, CANDIDATES)
        chosen, segment = points_of_segments(
            segments(cells, color, usable), candidates[usable[candidates]]
        )
        if len(chosen) < MIN_RECEIVERS:
            return None
        light = room.received(cells.point[chosen], cells.normal[chosen])
        outside = outside_radiance(frame.radiance[frame.opening], frame.opening).reshape(-1, 3)
        share = seen_share(frame.opening).reshape(-1, 1)
        turn = np.eye(3) if frame.pose is None else frame.pose[:3, :3]
        direction = View(2 * OUTSIDE_ROWS, OUTSIDE_ROWS, projection="equirect").directions()
        direction = direction.reshape(-1, 3) @ turn.T
        unseen = _by_nodes(light.windows, (1.0 - share) * outside, node_weights(direction))
        known = light.irradiance(share * outside)
        got = unseen.sum(axis=1)
        if (got / np.maximum(known + got, 1e-30)).mean() < MIN_UNSEEN:
            return None
        return cls(color[chosen], segment, known, unseen, _shown(share, direction))


def _receivers(
    frame: Frame, cells: Cells, room: RoomLight, sun: Float | None
) -> tuple[Float, NDArray[np.bool_]]:
    """Return the diffuse radiance (N, 3) of cells, and whether they are usable as receivers."""
    color = cell_means(frame.radiance, cells.rows).reshape(-1, 3)
    diffuse = finer(room.diffuse, cells.rows).reshape(-1, 3)
    usable = well_seen(cells) & (color.min(-1) > DARK * np.median(color))
    usable &= diffuse.min(axis=-1) > LEAST_DIFFUSE
    if frame.gloss is not None:
        glossy = cell_means(frame.gloss > 0, cells.rows).ravel() > 0.0
        usable &= ~glossy | (diffuse < 1.0).any(axis=-1)
    usable &= cell_means(spoilt(frame), cells.rows).ravel() == 0.0
    if sun is not None:
        usable &= ~_sunlit(cells, room.occluders, sun)
    return color * diffuse, usable


def _sunlit(cells: Cells, occluders: Cells, sun: Float) -> NDArray[np.bool_]:
    """Return (N,) whether the sun lights cells, or ones beside them."""
    facing = np.flatnonzero(cells.normal @ sun > 0.0)
    lit = np.zeros(len(cells.depth), bool)
    start = cells.point[facing] + SUN_LIFT * cells.depth[facing, None] * cells.normal[facing]
    lit[facing] = leaves(occluders, start, np.broadcast_to(sun, start.shape), SUN_STEPS)
    around = scipy.ndimage.binary_dilation(lit.reshape(cells.rows, -1), np.ones((3, 3)))
    return np.asarray(around.ravel())


def _by_nodes(
    windows: scipy.sparse.csr_array, outside: Float, weights: scipy.sparse.csr_array
) -> Float:
    """Return the irradiance (n, M, 3) by an environment (T, 3), split among nodes."""
    parts = [windows @ weights.multiply(channel[:, None]) for channel in outside.T]
    return np.stack([part.toarray() for part in parts], axis=-1)


def _shown(share: Float, direction: Float) -> Float:
    """Return directions (D, 3) spread over the windows, from shares and directions (T, ...)."""
    spread = spread_cells(OUTSIDE_ROWS, CANDIDATES)
    return np.asarray(direction[spread[share[spread, 0] > 0.5]])
