"""Irradiance of the surfaces that a panorama shows, from the light in it: coarse, and on the host.

A surface point x with normal n receives from a cell at y, whose surface of area A looks along m,

    F = cos(n, y - x) cos(m, x - y) A / (r² + cos(m, x - y) A / π)

times its radiance, if nothing between them hides it: the form factor of a point and a disc, finite
where they touch. What lies behind openings is infinitely far away, as the tracer takes it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cells import Cells, Float
from iprt.footage.window_environment import OUTSIDE_ROWS, outside_radiance
from iprt.geometry.equirect import cell_towards

THICKNESS, CLEARANCE = 0.15, 0.03
"""Fractions of depth: a line of sight is hidden where it is deeper below a surface than the
clearance, and passes behind where it is deeper than the thickness."""
AT_ONCE = 1 << 15
"""Lines of sight whose points fit a processor's cache."""
MIN_OPEN = 0.1
"""π minus what lights take: never less of a hemisphere sees the rest."""


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
