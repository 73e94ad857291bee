"""Light that surfaces of a panorama receive, by rays followed on the host."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cell_rays import ends, leaves
from iprt.footage.cells import GRAZING, Cells, Float, Geometry, cell_means
from iprt.footage.diffuse_share import diffuse_share
from iprt.footage.form_factors import form_factors
from iprt.footage.frame import Frame
from iprt.footage.sky import OUTSIDE_ROWS
from iprt.footage.threads import on_all_cores
from iprt.geometry.equirect import cell_towards, equirect_direction

OCCLUDER_ROWS, WINDOW_ROWS = 256, 64
"""Rows of cells that block rays, and of cells towards whose windows rays are aimed."""
RAYS, WINDOW_RAYS = 256, 2
"""Rays from a point to all surfaces, and to each cell with a window."""
STEPS = 100
"""Points at which rays are tested."""
LIFT = 0.01
"""Offset of rays' origins from their surface, relative to depth."""
MIN_SHARE = 0.05
"""Least share of surfaces in a cell, by which their radiance is divided."""
AT_ONCE = 32
"""Points whose rays are followed together."""
PLASTIC = 1.32471795724474602596
"""Plastic number, whose powers make the R2 sequence (Roberts 2018)."""


@dataclass(frozen=True)
class ReceivedLight:
    """Light that n points receive.

    Attributes
    ----------
    rest : (n, 3) float64
        Irradiance by surfaces and open sky.
    windows : (n, 2 OUTSIDE_ROWS²) sparse float64
        Projected solid angle, in sr, in which each texel of the environment behind windows is seen
        from each point.
    """

    rest: Float
    windows: scipy.sparse.csr_array

    def irradiance(self, outside: NDArray[np.floating] | None) -> Float:
        """Return irradiance (n, 3), with `outside_radiance` behind windows; None without any."""
        if outside is None:
            return self.rest
        return np.asarray(self.rest + self.windows @ outside.reshape(-1, 3))


@dataclass(frozen=True)
class RoomLight:
    """Surfaces of a frame as rays see them.

    Attributes
    ----------
    shown : Geometry
        Geometry from which coarser cells can be made.
    occluders, openings : Cells
        N cells that block rays, and coarser ones towards whose windows rays are aimed.
    diffuse : (r, 2 r, 3) float64
        `diffuse_share` of coarse cells.
    radiance : (N, 3) float64
        Diffuse radiance of surfaces and open sky in `occluders`, without windows.
    """

    shown: Geometry
    occluders: Cells
    openings: Cells
    diffuse: Float
    radiance: Float

    @classmethod
    def of(cls, frame: Frame, shown: Geometry) -> RoomLight:
        """Build them from a frame and its geometry."""
        rows, window_rows = (min(rows, frame.height) for rows in (OCCLUDER_ROWS, WINDOW_ROWS))
        dark = np.where(frame.opening[..., None], np.float32(0.0), frame.radiance)
        share = np.maximum(1.0 - cell_means(frame.opening, rows), MIN_SHARE)
        diffuse = diffuse_share(frame, shown)
        radiance = cell_means(dark, rows) / share[..., None] * finer(diffuse, rows)
        occluders, openings = (Cells.of(shown, count) for count in (rows, window_rows))
        return cls(shown, occluders, openings, diffuse, radiance.reshape(-1, 3))

    def received(self, point: Float, normal: Float) -> ReceivedLight:
        """Return the light at points (n, 3) of surfaces, in metres, with unit normals (n, 3)."""
        return ReceivedLight(self.from_surfaces(point, normal), self.through_windows(point, normal))

    def from_surfaces(self, point: Float, normal: Float) -> Float:
        """Return `ReceivedLight.rest` alone."""
        found = _in_batches(self._by_surfaces, point, normal)
        return np.concatenate([rest for _, rest in found])[_order(found)]

    def through_windows(
        self, point: Float, normal: Float, rays: int = WINDOW_RAYS
    ) -> scipy.sparse.csr_array:
        """Return `ReceivedLight.windows` alone, by a number of rays to each cell of a window."""

        def mean(start: Float, normal: Float, rng: np.random.Generator) -> scipy.sparse.csr_array:
            seen = [self._by_windows(start, normal, rng) for _ in range(rays)]
            return sum(seen[1:], start=seen[0]) / rays

        found = _in_batches(mean, point, normal)
        return scipy.sparse.vstack([part for _, part in found]).tocsr()[_order(found)]

    def _by_surfaces(self, start: Float, normal: Float, rng: np.random.Generator) -> Float:
        """Return irradiance (n, 3) by all but windows: Monte Carlo over the hemisphere."""
        direction = cosine_directions(normal, RAYS, rng).reshape(-1, 3)
        _, cell = ends(self.occluders, np.repeat(start, RAYS, axis=0), direction, STEPS)
        window = self.occluders.opening[cell] > 0.5
        found = np.where(window[:, None], 0.0, self.radiance[cell])
        return np.asarray(np.pi * found.reshape(len(start), RAYS, 3).mean(axis=1))

    def _by_windows(
        self, start: Float, normal: Float, rng: np.random.Generator
    ) -> scipy.sparse.csr_array:
        """Return `ReceivedLight.windows` by one ray to each cell with a window, anywhere in it."""
        chosen, rows = np.flatnonzero(self.openings.opening > 0.0), self.openings.rows
        corner = np.stack([chosen % (2 * rows), chosen // (2 * rows)], axis=-1)
        ahead = equirect_direction(corner + rng.random(corner.shape), 2 * rows, rows)
        at = cell_towards(ahead, np.ones(len(ahead)), self.occluders.rows)
        depth, facing = self.occluders.depth[at], self.occluders.normal[at]
        end = depth[:, None] * ahead
        cosine = np.maximum(np.abs((facing * ahead).sum(axis=-1)), GRAZING)
        area = self.openings.solid_angle[chosen] * depth**2 / cosine
        factor = form_factors(start, normal, end, facing, area)
        point, cell = np.nonzero(factor > 0.0)
        way = end[cell] - start[point]
        way /= np.linalg.norm(way, axis=-1)[:, None]
        free = leaves(self.occluders, start[point], way, STEPS)
        point, cell, way = point[free], cell[free], way[free]
        texel = cell_towards(way, np.ones(len(way)), OUTSIDE_ROWS)
        shape = (len(start), 2 * OUTSIDE_ROWS**2)
        return scipy.sparse.coo_array((factor[point, cell], (point, texel)), shape=shape).tocsr()


Batch = NDArray[np.intp]
Made = TypeVar("Made")
Kind = TypeVar("Kind", bound=np.generic)


def _in_batches(
    estimate: Callable[[Float, Float, np.random.Generator], Made], point: Float, normal: Float
) -> list[tuple[Batch, Made]]:
    """Return the estimates for batches of points, with the indices of these points."""
    start = point + LIFT * np.linalg.norm(point, axis=-1, keepdims=True) * normal
    # Points of one batch, which share the ends of rays, are far apart.
    count = -(-len(start) // AT_ONCE)
    batches = [np.arange(first, len(start), count) for first in range(count)]

    def batch(one: Batch) -> tuple[Batch, Made]:
        return one, estimate(start[one], normal[one], np.random.default_rng(one[0]))

    return on_all_cores(batch, batches)


def _order(found: Sequence[tuple[Batch, object]]) -> Batch:
    return np.argsort(np.concatenate([one for one, _ in found]))


def finer(values: NDArray[Kind], rows: int) -> NDArray[Kind]:
    """Return values (r, 2 r, ...) of cells for cells of another size, (rows, 2 rows, ...)."""
    at = np.arange(rows) * len(values) // rows
    across = np.arange(2 * rows) * values.shape[1] // (2 * rows)
    found: NDArray[Kind] = values[at[:, None], across]
    return found


def cosine_directions(normal: Float, count: int, rng: np.random.Generator) -> Float:
    """Return directions (n, count, 3) about normals (n, 3), with density cosine / π."""
    step = np.arange(count)
    height = (step / PLASTIC + rng.random((len(normal), 1))) % 1.0
    azimuth = 2.0 * np.pi * ((step / PLASTIC**2 + rng.random((len(normal), 1))) % 1.0)
    axis = np.eye(3)[np.abs(normal).argmin(axis=-1)]
    across = np.cross(normal, axis)
    across /= np.linalg.norm(across, axis=-1)[:, None]
    along = np.cross(normal, across)
    radius = np.sqrt(height)[..., None]
    flat = (
        np.cos(azimuth)[..., None] * across[:, None] + np.sin(azimuth)[..., None] * along[:, None]
    )
    return np.asarray(radius * flat + np.sqrt(1.0 - height)[..., None] * normal[:, None])
