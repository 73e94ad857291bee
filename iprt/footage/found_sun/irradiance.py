"""Irradiance of a sun, from both sides of the borders of its patches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cells import Cells, Float, Geometry, cell_means
from iprt.footage.form_factors import irradiance_of_lights, irradiance_of_rest
from iprt.footage.found_sun.receivers import Floats, Receivers
from iprt.footage.frame import LUMINANCE, Frame

LIGHT_ROWS, REST_ROWS = 64, 32
"""Rows of cells of lights, and of all other light."""
LIGHT_STEPS, REST_STEPS = 16, 6
"""Points at which lines of sight are tested."""
LEAST_SUPPORT = 0.02
"""Least share of a local mean's weight on each side of a border where both sides are compared."""
MIN_BORDER = 20
"""Least number of cells near borders."""
SAME_NORMAL, SAME_PLANE = 0.97, 0.03
"""Least cosine of the mean normals of both sides of a border, and largest distance of their mean
points across the surface, relative to depth."""
AGREEMENT = 8
"""Power of the local correlation of light and picture in weights. Where the pattern is a little
off, both sides are mixed and look alike."""


def irradiance_of_sun(
    frame: Frame, shown: Geometry, receivers: Receivers, direction: Float
) -> tuple[float, float, float] | None:
    """Return the irradiance of a surface perpendicular to the sun; None with too few borders.

    The quotient of radiance of a surface in the patch and beside it is (E + S cos) / E, with the
    irradiance E by all other light. It is taken where both sides are on one plane.

    Parameters
    ----------
    frame : Frame
        Without the sun's disc.
    shown : Geometry
    receivers : Receivers
    direction : (3,) float64
        Unit vector towards the sun.
    """
    cosine, weight = receivers.facing(direction)
    is_lit = receivers.lit(direction) > 0.0
    sides = [weight * is_lit, weight * ~is_lit]
    support = receivers.mean.sums(np.stack(sides, axis=-1))
    share = support.min(axis=-1) / np.maximum(support.sum(axis=-1), np.float32(1e-12))
    near = np.flatnonzero((weight > 0.0) & (share > LEAST_SUPPORT))
    bright = np.log(np.maximum(receivers.color, 1e-30))
    features = np.concatenate([bright, receivers.cells.normal, receivers.cells.point], axis=-1)
    lit, shaded = (_means(receivers, features, side)[near] for side in sides)
    trust = weight[near] * share[near] * _on_one_plane(receivers, near, lit, shaded)
    if np.count_nonzero(trust) < MIN_BORDER:
        return None
    trust *= _agreement(receivers, is_lit, bright, weight)[near] ** AGREEMENT
    others = _other_irradiance(frame, shown, receivers, near)
    sun = others * np.expm1(lit[:, :3] - shaded[:, :3]) / cosine[near, None]
    middle = np.quantile(sun, 0.5, axis=0, weights=trust, method="inverted_cdf")
    red, green, blue = np.maximum(middle, 0.0).tolist()
    return (red, green, blue) if red + green + blue > 0.0 else None


def _means(receivers: Receivers, values: Float, weight: Floats) -> Floats:
    """Return the local means (N, C) of values (N, C), with one weight (N,) for all."""
    return receivers.mean(values.astype(np.float32), weight[:, None])


def _on_one_plane(
    receivers: Receivers, near: NDArray[np.intp], lit: Floats, shaded: Floats
) -> NDArray[np.bool_]:
    """Return (n,) whether both sides of the border near cells are on the cells' plane.

    `lit` and `shaded` (n, 9) are mean log-radiance, normal and point of the sides.
    """
    cells = receivers.cells
    normal, depth = cells.normal[near], cells.depth[near]
    ends = [side[:, 3:6] / np.linalg.norm(side[:, 3:6], axis=-1)[:, None] for side in (lit, shaded)]
    like = np.minimum(*((end * normal).sum(axis=-1) for end in ends))
    apart = np.abs(((lit - shaded)[:, 6:] * normal).sum(axis=-1))
    return np.asarray((like > SAME_NORMAL) & (apart < SAME_PLANE * depth))


def _agreement(
    receivers: Receivers, is_lit: NDArray[np.bool_], bright: Float, weight: Floats
) -> Floats:
    """Return the local correlation (N,) of sunlight and log-luminance, at least 0."""
    seen = np.log(np.maximum(np.exp(bright) @ LUMINANCE, 1e-30))
    light = is_lit.astype(np.float64)
    values = np.stack([light, seen, light * seen, seen**2], axis=-1)
    share, mean, both, square = _means(receivers, values, weight).T
    spread = share * (1.0 - share) * (square - mean**2)
    return np.asarray(np.maximum(both - share * mean, 0.0) / np.sqrt(np.maximum(spread, 1e-12)))


def _other_irradiance(
    frame: Frame, shown: Geometry, receivers: Receivers, chosen: NDArray[np.intp]
) -> Float:
    """Return the irradiance (n, 3) of chosen cells by all that the panorama shows."""
    middle, rest = (Cells.of(shown, min(rows, frame.height)) for rows in (LIGHT_ROWS, REST_ROWS))
    start, normal = receivers.start[chosen], receivers.cells.normal[chosen]
    radiance = frame.radiance
    through = np.where(frame.opening[..., None], radiance, np.float32(0.0))
    lights = cell_means(through, middle.rows).reshape(-1, 3, 1)
    direct, taken = irradiance_of_lights(
        start, normal, middle, receivers.occluders, lights, LIGHT_STEPS
    )
    dim = cell_means(radiance - through, rest.rows).reshape(-1, 3)
    share = 1.0 - np.minimum(rest.opening, 1.0)
    reflected = irradiance_of_rest(start, normal, rest, dim, share, taken, REST_STEPS)
    return np.asarray(direct[..., 0] + reflected)
