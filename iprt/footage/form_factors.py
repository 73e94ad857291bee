"""Irradiance of a panorama's surfaces by the light in it, computed coarsely on the host.

A surface point x with normal n receives, from a cell at y with area A and normal m,

    F = cos(n, y - x) cos(m, x - y) A / (r² + cos(m, x - y) A / π)

times the cell's radiance if nothing occludes it. F is the form factor between a point and a disc,
which stays finite where they touch. Light behind openings is infinitely far away, as in the tracer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cells import Cells, Float
from iprt.footage.sky import OUTSIDE_ROWS
from iprt.footage.window_environment import outside_radiance
from iprt.geometry.equirect import cell_towards

THICKNESS, CLEARANCE = 0.15, 0.03
"""Bounds relative to depth: a line of sight is occluded where it is deeper below a surface than the
clearance, and passes behind the surface where it is deeper than the thickness."""
AT_ONCE = 1 << 15
"""Number of lines of sight whose points fit into a processor's cache."""
MIN_OPEN = 0.1
"""Least projected solid angle, out of π, that lights leave to all other surfaces."""


def visible(cells: Cells, x: Float, y: Float, steps: int) -> NDArray[np.bool_]:
    """Return (n, m) bool: whether points x (n, 3) and y (m, 3) see each other."""
    depth = cells.depth.astype(np.float32)
    # Separate coordinates: NumPy takes several times as long on arrays of three.
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


def form_factors(x: Float, n: Float, y: Float, facing: Float, area: Float) -> Float:
    """Return form factors (n, m) between points and small surfaces, without visibility.

    Parameters
    ----------
    x, n : (n, 3) float64
        Points and their normals.
    y, facing : (m, 3) float64
        Middles of the surfaces, and their normals.
    area : (m,) float64
        Square metres.

    Returns
    -------
    (n, m) float64
        F as defined in this module; the sum over a closed room is π.
    """
    way = y - x[:, None]
    squared = np.maximum((way * way).sum(-1), 1e-24)
    inverse = 1.0 / np.sqrt(squared)
    leaving = np.maximum(np.einsum("ijk,ik->ij", way, n) * inverse, 0.0)
    arriving = np.maximum(-np.einsum("ijk,jk->ij", way, facing) * inverse, 0.0)
    seen = arriving * area
    return np.asarray(leaving * seen / (squared + seen / np.pi))


def irradiance_of_lights(
    x: Float, n: Float, cells: Cells, fine: Cells, lights: Float, steps: int
) -> tuple[Float, Float]:
    """Compute the irradiance by each light, and the solid angle that lights and openings take.

    Parameters
    ----------
    x, n : (n, 3) float64
        Points in metres, and their normals.
    cells, fine : Cells
        N cells, and finer ones for visibility.
    lights : (N, 3, K) float64
        Radiance due to each of K lights, averaged over cells.
    steps : int
        Number of points at which visibility is tested.

    Returns
    -------
    irradiance : (n, 3, K) float64
    taken : (n,) float64
        Projected solid angle of lights and openings, in [0, π].
    """
    chosen = np.flatnonzero((lights.sum(axis=(1, 2)) > 0.0) | (cells.opening > 0.0))
    factors = form_factors(x, n, cells.point[chosen], cells.normal[chosen], cells.area[chosen])
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
    """Return `outside_radiance` of cells, from the radiance (N, 3) in their openings."""
    shape = (cells.rows, 2 * cells.rows)
    opening = cells.opening > 0.5
    light = radiance[opening] / cells.opening[opening, None]
    return outside_radiance(light, opening.reshape(shape))


def irradiance_of_rest(
    x: Float, n: Float, cells: Cells, radiance: Float, share: Float, taken: Float, steps: int
) -> Float:
    """Compute the irradiance (n, 3) from all surfaces without lights and openings.

    It is their mean radiance as seen from a point, times the projected solid angle that lights
    and openings leave. Hidden parts of a room thus count like visible ones.

    Parameters
    ----------
    x, n : (n, 3) float64
        Points in metres, and their normals.
    cells : Cells
        N cells.
    radiance : (N, 3) float64
        Means over cells.
    share : (N,) float64
        Share of each cell that is neither light nor opening.
    taken : (n,) float64
        See `irradiance_of_lights`.
    steps : int
        Number of points at which visibility is tested.
    """
    chosen = np.flatnonzero(share > 0.0)
    area = cells.area[chosen] * share[chosen]
    factors = form_factors(x, n, cells.point[chosen], cells.normal[chosen], area)
    factors *= visible(cells, x, cells.point[chosen], steps)
    left = np.maximum(np.pi - taken, MIN_OPEN)
    total = np.maximum(factors.sum(1), MIN_OPEN)
    mean = radiance[chosen] / share[chosen, None]
    return np.asarray((factors @ mean) * (left / total)[:, None])
