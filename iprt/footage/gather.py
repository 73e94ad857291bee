"""Irradiance of the surfaces that a panorama shows, from the light in it: coarse, and on the host.

The panorama is cut into equirect cells, each of which stands for what it shows. A surface point x
with normal n receives from a cell at y, whose surface of area A looks along m,

    F = cos(n, y - x) cos(m, x - y) A / (r² + cos(m, x - y) A / π)

times its radiance, if nothing between them hides it: the form factor of a point and a disc, finite
where they touch. What lies behind openings is infinitely far away, as the tracer takes it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.footage.window_environment import OUTSIDE_ROWS, outside_radiance
from iprt.geometry.camera import View
from iprt.geometry.equirect import cell_towards, solid_angles

Float = NDArray[np.float64]

SKY = 50.0
"""Open sky lies so many times as far as the farthest surface."""
GRAZING = 0.1
"""Least cosine at which the area that a cell shows is taken from its normal."""
THICKNESS, CLEARANCE = 0.15, 0.03
"""Fractions of depth: a line of sight is hidden where it is deeper below a surface than the
clearance, and passes behind where it is deeper than the thickness."""
NORMAL_ROWS = 1024
"""Rows of texels, or up to twice as many, that normals are fitted to: ten to a cell say enough."""
AT_ONCE = 1 << 15
"""Lines of sight whose points fit a processor's cache."""
MIN_OPEN = 0.1
"""π minus what lights take: never less of a hemisphere sees the rest."""


def cell_sums(picture: NDArray[np.generic], rows: int) -> Float:
    """Sums (rows, 2 rows, ...) over the cells of a picture (H, 2 H, ...); H >= `rows`."""
    down, across = _cell_ends(picture.shape, rows)
    # Along rows alone: `reduceat` takes ten times as long across them.
    strips = [picture[a:b].sum(axis=0, dtype=np.float64) for a, b in pairwise(down)]
    return np.asarray(np.add.reduceat(np.stack(strips), across[:-1], axis=1))


def cell_means(picture: NDArray[np.generic], rows: int) -> Float:
    """The same divided by the number of texels in each."""
    sums = cell_sums(picture, rows)
    return _over(sums, cell_texels(picture.shape, rows))


def cell_texels(shape: tuple[int, ...], rows: int) -> NDArray[np.intp]:
    """(rows, 2 rows) numbers of texels in the cells of a picture of that shape."""
    down, across = _cell_ends(shape, rows)
    return np.outer(np.diff(down), np.diff(across))


def _cell_ends(shape: tuple[int, ...], rows: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(rows + 1,) and (2 rows + 1,) first texels of cells; ends of coarser cells are among them."""
    height, width = shape[:2]
    down = -(-np.arange(rows + 1) * height // rows)
    return down, -(-np.arange(2 * rows + 1) * width // (2 * rows))


def _over(sums: Float, texels: NDArray[np.number]) -> Float:
    return np.asarray(sums / texels.reshape(*texels.shape, *[1] * (sums.ndim - 2)))


def sampled_normals(frame: Frame) -> NDArray[np.float32]:
    """(h, w, 3): `Frame.fitted_normal`, of large panoramas by every so many texels.

    Fitting them to all takes the host long.
    """
    step = frame.height // NORMAL_ROWS
    if step < 2:
        return frame.fitted_normal
    chosen = (slice(step // 2, None, step),) * 2
    normal = None if frame.normal is None else frame.normal[chosen]
    depth, opening = frame.depth[chosen], frame.opening[chosen]
    return replace(frame, depth=depth, opening=opening, normal=normal).fitted_normal


@dataclass(frozen=True)
class Geometry:
    """What a frame shows of surfaces, added up in cells, from which coarser ones are made.

    Attributes
    ----------
    texels : (R, 2 R) int
    inverse, squared : (R, 2 R) float64
        Sums of inverse depth in 1/m, and of its square.
    normal : (R, 2 R, 3) float64
        Mean normals times `texels`.
    opening, sky : (R, 2 R) float64
        Numbers of texels.
    """

    texels: NDArray[np.intp]
    inverse: Float
    squared: Float
    normal: Float
    opening: Float
    sky: Float

    @classmethod
    def of(cls, frame: Frame, rows: int) -> Geometry:
        """In cells of the finest kind that is asked for; `rows` at most the frame's."""
        finite = np.isfinite(frame.depth)
        far = float(frame.depth[finite].max()) if finite.any() else 1.0
        inverse = np.float32(1.0) / np.where(finite, frame.depth, np.float32(SKY * far))
        texels = cell_texels(frame.depth.shape, rows)
        return cls(
            texels=texels,
            inverse=cell_sums(inverse, rows),
            squared=cell_sums(np.square(inverse, out=inverse), rows),
            normal=cell_means(sampled_normals(frame), rows) * texels[..., None],
            opening=cell_sums(frame.opening, rows),
            sky=cell_sums(~finite, rows),
        )

    def mean(self, sums: Float, rows: int) -> Float:
        """Means (rows, 2 rows, ...) of what one of these sums adds up."""
        return _over(cell_sums(sums, rows), cell_sums(self.texels, rows))


@dataclass(frozen=True)
class Cells:
    """Surfaces of a panorama in cells, row by row.

    Attributes
    ----------
    rows : int
        Half as many as columns; N = 2 rows².
    direction, point, normal : (N, 3) float64
        From the capture centre; points in metres.
    depth : (N,) float64
        Metres.
    area : (N,) float64
        Area of the surface that the cell shows, in m².
    solid_angle : (N,) float64
        sr about the capture centre.
    opening, sky : (N,) float64
        Shares of the cell, in [0, 1].
    rough : (N,) float64
        Spread of inverse depth in the cell over its mean, plus how much normals differ.
    """

    rows: int
    direction: Float
    point: Float
    normal: Float
    depth: Float
    area: Float
    solid_angle: Float
    opening: Float
    sky: Float
    rough: Float

    @classmethod
    def of(cls, shown: Geometry, rows: int) -> Cells:
        """As many as `shown` has, or coarser ones."""
        mean = shown.mean(shown.inverse, rows).ravel()
        squared = shown.mean(shown.squared, rows).ravel()
        spread = np.sqrt(np.maximum(squared - mean**2, 0.0)) / mean
        direction = View(2 * rows, rows, projection="equirect").directions().reshape(-1, 3)
        normal = shown.mean(shown.normal, rows).reshape(-1, 3)
        length = np.linalg.norm(normal, axis=-1)
        normal = np.where(
            length[:, None] > 0.3, normal / np.maximum(length, 1e-9)[:, None], -direction
        )
        solid_angle = np.repeat(solid_angles(2 * rows, rows), 2 * rows)
        depth = 1.0 / mean
        facing = np.abs((normal * direction).sum(-1))
        return cls(
            rows=rows,
            direction=direction,
            point=direction * depth[:, None],
            normal=normal,
            depth=depth,
            area=solid_angle * depth**2 / np.maximum(facing, GRAZING),
            solid_angle=solid_angle,
            opening=shown.mean(shown.opening, rows).ravel(),
            sky=shown.mean(shown.sky, rows).ravel(),
            rough=spread + 1.0 - np.minimum(length, 1.0),
        )


def visible(cells: Cells, x: Float, y: Float, steps: int) -> NDArray[np.bool_]:
    """(n, m) bool: nothing in the panorama stands between points x (n, 3) and y (m, 3)."""
    depth = cells.depth.astype(np.float32)
    # By coordinates: three at a time take NumPy several times as long.
    start, end = (np.ascontiguousarray(end.T, np.float32) for end in (x, y))
    free = np.ones((len(x), len(y)), bool)
    block = max(1, AT_ONCE // max(len(y), 1))
    for first in range(0, len(x), block):
        here = start[:, first : first + block, None]
        way = end[:, None] - here
        for step in range(steps):
            point = here + np.float32(0.02 + 0.94 * (step + 0.5) / steps) * way
            radius = np.sqrt(np.einsum("ijk,ijk->jk", point, point))
            front = depth[cell_towards(np.moveaxis(point, 0, -1), radius, cells.rows)]
            below = radius - front
            passes = (below <= CLEARANCE * front) | (below >= THICKNESS * front)
            free[first : first + block] &= passes
    return free


def form_factors(x: Float, n: Float, cells: Cells, chosen: NDArray[np.intp], share: Float) -> Float:
    """(n, m) form factors, see above, of points x, n (n, 3) and cells (m,), of which `share` (m,)
    counts; without visibility. Of a closed room they sum up to π."""
    way = cells.point[chosen] - x[:, None]
    squared = np.maximum((way * way).sum(-1), 1e-24)
    inverse = 1.0 / np.sqrt(squared)
    leaving = np.maximum(np.einsum("ijk,ik->ij", way, n) * inverse, 0.0)
    arriving = np.maximum(-np.einsum("ijk,jk->ij", way, cells.normal[chosen]) * inverse, 0.0)
    seen = arriving * (cells.area[chosen] * share)
    return np.asarray(leaving * seen / (squared + seen / np.pi))


@dataclass(frozen=True)
class Receivers:
    """Points of surfaces: `point` (n, 3) in metres and `normal` (n, 3)."""

    point: Float
    normal: Float


def irradiance_of_lights(
    receivers: Receivers, cells: Cells, fine: Cells, lights: Float, steps: int
) -> tuple[Float, Float]:
    """Irradiance that each light brings, and what of the hemisphere lights and openings take.

    Parameters
    ----------
    receivers : Receivers
        n points.
    cells, fine : Cells
        N cells, and finer ones for visibility.
    lights : (N, 3, K) float64
        Radiance of cells due to each of K lights, means over the cells.

    Returns
    -------
    irradiance : (n, 3, K) float64
    taken : (n,) float64
        In [0, π].
    """
    chosen = np.flatnonzero((lights.sum(axis=(1, 2)) > 0.0) | (cells.opening > 0.0))
    x, n = receivers.point, receivers.normal
    factors = form_factors(x, n, cells, chosen, np.ones(len(chosen)))
    factors *= visible(fine, x, cells.point[chosen], steps)
    outside = cells.opening[chosen] > 0.5
    found = np.einsum("ij,jck->ick", factors[:, ~outside], lights[chosen[~outside]])
    if outside.any():
        far = chosen[outside]
        way = cells.point[far] - x[:, None]
        at = cell_towards(way, np.linalg.norm(way, axis=-1), OUTSIDE_ROWS)
        for light in range(lights.shape[2]):
            there = lights[..., light]
            if there[far].any():
                distant = distant_light(there, cells).reshape(-1, 3)
                found[..., light] += np.einsum("ij,ijc->ic", factors[:, outside], distant[at])
    return found, np.minimum(factors.sum(1), np.pi)


def distant_light(radiance: Float, cells: Cells) -> NDArray[np.float32]:
    """`outside_radiance` of cells (N, 3), whose openings' radiance it is."""
    shape = (cells.rows, 2 * cells.rows)
    opening = cells.opening > 0.5
    light = radiance[opening] / cells.opening[opening, None]
    return outside_radiance(light, opening.reshape(shape))


def irradiance_of_rest(
    receivers: Receivers, cells: Cells, radiance: Float, share: Float, taken: Float, steps: int
) -> Float:
    """Irradiance (n, 3) by all that is no light and no opening.

    It is the mean radiance that a point sees of it, over the hemisphere that lights leave: so what
    the panorama does not show of a room counts as what it does show.

    Parameters
    ----------
    radiance : (N, 3) float64
        Means over cells, of which `share` (N,) is neither light nor opening.
    taken : (n,) float64
        See `irradiance_of_lights`.
    """
    chosen = np.flatnonzero(share > 0.0)
    x = receivers.point
    factors = form_factors(x, receivers.normal, cells, chosen, share[chosen])
    factors *= visible(cells, x, cells.point[chosen], steps)
    left = np.maximum(np.pi - taken, MIN_OPEN)
    total = np.maximum(factors.sum(1), MIN_OPEN)
    mean = radiance[chosen] / share[chosen, None]
    return np.asarray((factors @ mean) * (left / total)[:, None])
