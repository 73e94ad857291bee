"""Search for a sun that the panorama does not show, by the patches that it lights.

Analysis by synthesis: for each direction of the upper hemisphere, rays from the surfaces tell where
a sun there would shine. Its pattern of light is correlated with the logarithm of the radiance, both
less their local means. Windows, frames and leaves make patterns that fit one direction only. A sun
counts as found only where the correlation is high, and no other direction comes close.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.albedo_segments import well_seen
from iprt.footage.cells import Cells, Float, Geometry, cell_means
from iprt.footage.form_factors import irradiance_of_lights, irradiance_of_rest
from iprt.footage.found_sun.local_mean import LocalMean
from iprt.footage.found_sun.sky_rays import leaves
from iprt.footage.frame import LUMINANCE, Frame
from iprt.footage.sun import Sun
from iprt.footage.threads import on_all_cores

Floats = NDArray[np.float32]

COARSE_ROWS, FINE_ROWS, LIGHT_ROWS, REST_ROWS = 64, 128, 64, 32
"""Rows of cells: receivers of the search, receivers of its refinement and occluders, lights, and
all other light."""
DIRECTIONS = 350
"""Directions of the upper hemisphere that are tried: one every 7.7°."""
WIDTH = np.deg2rad(7.0)
"""Width of the local means: shading varies more slowly, and patches have borders within it."""
LIFT = 0.005
"""Offset of receivers from their surface, relative to depth. Four times as much moves patches by
half a degree of the sun."""
COARSE_STEPS, FINE_STEPS = 50, 100
"""Points at which rays are tested, in the search and in its refinement."""
LOWEST = 0.05
"""Least cosine between a receiver's normal and the sun."""
DARK = 1e-3
"""Radiance relative to the median below which noise corrupts a logarithm."""
COARSE_ROUNDS, FINE_ROUNDS, TRIES = (6.0, 2.5), (1.0, 0.4), 20
"""Widths, in degrees, of the rounds of refinement on coarse and fine cells; directions in each."""
APART = np.deg2rad(25.0)
"""Angle from the best direction beyond which another one is another peak."""
MIN_CORRELATION, MIN_LEAD = 0.33, 1.2
"""Least correlation of a sun, and least quotient of it and the next other peak's."""
LEAST_SUPPORT = 0.02
"""Least share of a local mean's weight on each side of a border where both sides are compared."""
LIGHT_STEPS, REST_STEPS = 16, 6
"""Points at which lines of sight of the irradiance are tested."""
MIN_BORDER = 20
"""Least number of cells near borders, for the irradiance."""


@dataclass(frozen=True)
class _Receivers:
    """Surfaces on which patches of sunlight are looked for.

    Attributes
    ----------
    cells, occluders : Cells
        N cells, and the ones that block rays.
    start : (N, 3) float64
        Origins of rays in metres.
    color : (N, 3) float64
        Mean radiance.
    usable : (N,) bool
        Cells that show one diffuse surface, not clipped and not black.
    mean : LocalMean
    steps : int
        Points at which rays are tested.
    """

    cells: Cells
    occluders: Cells
    start: Float
    color: Float
    usable: NDArray[np.bool_]
    mean: LocalMean
    steps: int

    @classmethod
    def of(
        cls, frame: Frame, shown: Geometry, occluders: Cells, rows: int, steps: int
    ) -> _Receivers:
        cells = Cells.of(shown, rows)
        color = cell_means(frame.radiance, rows).reshape(-1, 3)
        usable = well_seen(cells) & (color.min(-1) > DARK * np.median(color))
        usable &= cell_means(_spoilt(frame), rows).ravel() == 0.0
        start = cells.point + LIFT * cells.depth[:, None] * cells.normal
        return cls(cells, occluders, start, color, usable, LocalMean(rows, WIDTH), steps)

    def lit(self, direction: Float) -> Floats:
        """Return the cosine (N,) of a distant light where it reaches usable cells, else 0."""
        cosine = self.cells.normal @ direction
        there = np.flatnonzero(self.usable & (cosine > LOWEST))
        result = np.zeros(len(cosine), np.float32)
        way = np.broadcast_to(direction, (len(there), 3))
        result[there] = cosine[there] * leaves(self.occluders, self.start[there], way, self.steps)
        return result

    def correlations(self, directions: Float) -> Floats:
        """Return the correlation (D,) of each direction's light with the picture."""
        lit = np.stack(on_all_cores(self.lit, directions), axis=-1)
        faces = self.usable[:, None] & (self.cells.normal @ directions.T > LOWEST)
        weight = np.where(faces, self.cells.solid_angle[:, None], 0.0).astype(np.float32)
        seen = np.log(np.maximum(self.color @ LUMINANCE, 1e-30)).astype(np.float32)
        light = lit - self.mean(lit, weight)
        shown = seen[:, None] - self.mean(np.where(faces, seen[:, None], 0.0), weight)
        both, own, other = (
            (weight * part).sum(axis=0) for part in (light * shown, light**2, shown**2)
        )
        return np.asarray(both / np.sqrt(np.maximum(own * other, 1e-20)))


def find_sun(frame: Frame) -> Sun | None:
    """Return the sun that lights patches of a frame's surfaces; None without sure evidence.

    Parameters
    ----------
    frame : Frame
        Sanitized, with recovered clipped lights.
    """
    fine_rows = min(FINE_ROWS, frame.height)
    shown = Geometry.of(frame, fine_rows)
    occluders = Cells.of(shown, fine_rows)
    if not ((occluders.opening + occluders.sky) > 0.5).any():
        return None
    coarse = _Receivers.of(frame, shown, occluders, min(COARSE_ROWS, fine_rows), COARSE_STEPS)
    tried = upper_hemisphere(DIRECTIONS)
    found = coarse.correlations(tried)
    best = float(found.max())
    other = float(found[tried @ tried[found.argmax()] < np.cos(APART)].max(initial=0.0))
    if best < MIN_CORRELATION or best < MIN_LEAD * other:
        return None
    direction, _ = _refined(coarse, tried[np.argsort(found)[-3:]], COARSE_ROUNDS)
    fine = _Receivers.of(frame, shown, occluders, fine_rows, FINE_STEPS)
    direction, correlation = _refined(fine, direction[None], FINE_ROUNDS)
    irradiance = _irradiance(frame, shown, fine, direction)
    return None if irradiance is None else Sun(direction, irradiance, correlation=correlation)


def _spoilt(frame: Frame) -> NDArray[np.bool_]:
    """Return texels (H, W) whose picture is no diffuse radiance: mirrors, and clipped lights."""
    metals = [i + 1 for i, one in enumerate(frame.real_materials) if one.kind != "plastic"]
    none = np.zeros(frame.depth.shape, bool)
    spoilt = none if frame.gloss is None else np.isin(frame.gloss, metals)
    if frame.clipped is not None:
        spoilt.ravel()[frame.clipped.texel] = True
    return spoilt


def upper_hemisphere(count: int) -> Float:
    """Return directions (count, 3) spread over the upper hemisphere by a Fibonacci spiral."""
    turn = np.arange(count) + 0.5
    height = turn / count
    azimuth = turn * np.pi * (1.0 + 5.0**0.5)
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(azimuth), height, across * np.sin(azimuth)], axis=-1)


def _refined(receivers: _Receivers, starts: Float, widths: Sequence[float]) -> tuple[Float, float]:
    """Return the best direction near some directions (K, 3), and its correlation."""
    rng = np.random.default_rng(0)
    best, value, around = starts[-1], -1.0, starts
    for width in widths:
        step = np.deg2rad(width) * rng.standard_normal((len(around), TRIES, 3))
        tried = (around[:, None] + step).reshape(-1, 3)
        tried = np.concatenate([around, tried[tried[:, 1] > 0.0]])
        tried /= np.linalg.norm(tried, axis=-1, keepdims=True)
        found = receivers.correlations(tried)
        best, value = tried[found.argmax()], float(found.max())
        around = best[None]
    return best, value


def _irradiance(
    frame: Frame, shown: Geometry, receivers: _Receivers, direction: Float
) -> tuple[float, float, float] | None:
    """Return the sun's irradiance, perpendicular to it, from both sides of borders of patches.

    The quotient of radiance of a surface in the patch and beside it is (E + S cos) / E, with the
    irradiance E by all other light.
    """
    cells, color = receivers.cells, receivers.color
    lit = receivers.lit(direction)
    cosine = cells.normal @ direction
    faces = receivers.usable & (cosine > LOWEST)
    weight = np.where(faces, cells.solid_angle, 0.0).astype(np.float32)
    sides = np.stack([weight * (lit > 0.0), weight * (lit == 0.0)], axis=-1)
    support = receivers.mean.sums(sides)
    share = support / np.maximum(support.sum(axis=-1, keepdims=True), np.float32(1e-12))
    near = np.flatnonzero(faces & (share.min(axis=-1) > LEAST_SUPPORT))
    if len(near) < MIN_BORDER:
        return None
    bright = np.log(np.maximum(color, 1e-30)).astype(np.float32)
    jump = np.stack(
        [
            np.subtract(*receivers.mean(np.repeat(bright[:, c, None], 2, axis=1), sides)[near].T)
            for c in range(3)
        ],
        axis=-1,
    )
    others = _other_irradiance(frame, shown, receivers, near, lit)
    sun = others * np.expm1(jump) / cosine[near, None]
    # Cells with as much on one side as on the other count most.
    trust = weight[near] * share[near].min(axis=-1)
    middle = np.quantile(sun, 0.5, axis=0, weights=trust, method="inverted_cdf")
    red, green, blue = np.maximum(middle, 0.0).tolist()
    return (red, green, blue) if red + green + blue > 0.0 else None


def _other_irradiance(
    frame: Frame, shown: Geometry, receivers: _Receivers, chosen: NDArray[np.intp], lit: Floats
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
