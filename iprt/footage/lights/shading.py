"""Shading of the surfaces of a frame by its clipped lights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.albedo_segments import (
    lifted,
    points_of_segments,
    segments,
    spread_cells,
    well_seen,
)
from iprt.footage.cells import Cells, Float, Geometry, binned, cell_means, cell_sums, cell_texels
from iprt.footage.form_factors import irradiance_of_lights, irradiance_of_rest
from iprt.footage.frame import Frame
from iprt.footage.lights.gains import Shading
from iprt.footage.lights.groups import Clipped, Light, grid_cells

FINE_ROWS, LIGHT_ROWS, REST_ROWS = 128, 64, 32
"""Rows of cells: for receivers and occluders, for lights, and for all other light."""
LIGHT_STEPS, REST_STEPS = 16, 6
"""Numbers of points at which visibility is tested along a line of sight."""
CANDIDATES = 1000
"""Number of cells, spread over the sphere, that are candidates for receivers."""
MIN_RECEIVERS = 20
SHINE_POINTS, MOSTLY = 12, 0.75
"""Number of points per clipped surface whose emission is tested, and least clipped share of their
cells."""
DARK = 1e-3
"""Radiance relative to white below which noise and quantisation corrupt a logarithm."""


def shading_of(
    frame: Frame, clipped: Clipped, group: NDArray[np.intp], lights: Sequence[Light], white: float
) -> Shading | None:
    """Compute the shading of surfaces by lights; None if too few surfaces are well seen.

    Parameters
    ----------
    frame : Frame
    clipped : Clipped
    group : (N,) int
        Group of each clipped texel, 0 for none.
    lights : sequence of Light
    white : float
        Linear radiance of the white level.
    """
    shown = Geometry.of(frame, min(FINE_ROWS, frame.height))
    fine, middle, coarse = (
        Cells.of(shown, min(rows, frame.height)) for rows in (FINE_ROWS, LIGHT_ROWS, REST_ROWS)
    )
    sums = cell_sums(frame.color, fine.rows)
    color = (sums / shown.texels[..., None]).reshape(-1, 3)
    usable = _usable(frame, clipped, fine) & (color.min(-1) > DARK * white)
    candidates = spread_cells(fine.rows, CANDIDATES)
    chosen, segment = points_of_segments(
        segments(fine, color, usable), candidates[usable[candidates]]
    )
    if len(chosen) < MIN_RECEIVERS:
        return None
    shining, of_light = _shining(frame, clipped, group, lights, fine)
    at = np.concatenate([chosen, shining])
    receivers = lifted(fine, at), fine.normal[at]
    radiance = _light_cells(frame, clipped, group, lights, middle.rows)
    direct, taken = irradiance_of_lights(*receivers, middle, fine, radiance, LIGHT_STEPS)
    share, dim = _rest(frame, clipped, cell_sums(sums, coarse.rows))
    rest = direct[..., -1] + irradiance_of_rest(*receivers, coarse, dim, share, taken, REST_STEPS)
    direct, n = direct[..., :-1], len(chosen)
    return Shading(
        radiance=color[chosen],
        segment=segment,
        rest=rest[:n],
        lights=direct[:n],
        shine=np.minimum(color[shining], white),
        shining=of_light,
        shine_rest=rest[n:],
        shine_lights=direct[n:],
    )


def _rest(frame: Frame, clipped: Clipped, sums: Float) -> tuple[Float, Float]:
    """Return light that is neither clipped nor from openings, by cell.

    `sums` (rows, 2 rows, 3) are sums over all texels of each cell. Returns the share (N,) of such
    texels, and their radiance (N, 3), averaged over the whole cells.
    """
    rows, count = sums.shape[0], 2 * sums.shape[0] ** 2
    left_out = frame.opening.copy()
    left_out.ravel()[clipped.texel] = True
    texel = np.flatnonzero(left_out)
    cell, color = grid_cells(frame, texel, rows), frame.color.reshape(-1, 3)[texel]
    texels = cell_texels(frame.depth.shape, rows).ravel()
    rest = sums.reshape(-1, 3) - binned(color, cell, count)
    plain = texels - np.bincount(cell, minlength=count)
    # Cells without such texels would keep a rounding error.
    rest = np.where(plain[:, None] > 0, np.maximum(rest, 0.0), 0.0)
    return plain / texels, rest / texels[:, None]


def _usable(frame: Frame, clipped: Clipped, cells: Cells) -> NDArray[np.bool_]:
    """Return (N,) whether cells are well seen, diffuse, and not next to clipped ones."""
    hot = np.zeros(2 * cells.rows**2, bool)
    hot[grid_cells(frame, clipped.texel, cells.rows)] = True
    hot = scipy.ndimage.binary_dilation(hot.reshape(cells.rows, -1), np.ones((3, 3))).ravel()
    usable = well_seen(cells) & ~hot
    if frame.gloss is not None:
        usable &= cell_means(frame.gloss > 0, cells.rows).ravel() == 0.0
    return np.asarray(usable)


def _light_cells(
    frame: Frame,
    clipped: Clipped,
    group: NDArray[np.intp],
    lights: Sequence[Light],
    rows: int,
) -> Float:
    """Return mean radiance (cells, 3, K + 1) of cells by light, as stored.

    The last entry is all other light of clipped texels, and light through openings.
    """
    cells = 2 * rows * rows
    texels = cell_texels(frame.depth.shape, rows).ravel()
    color = frame.color.reshape(-1, 3)
    lost = color[clipped.texel] * clipped.share
    cell = grid_cells(frame, clipped.texel, rows)

    def means(values: NDArray[np.floating], where: NDArray[np.intp]) -> Float:
        return binned(values, where, cells) / texels[:, None]

    result = np.zeros((cells, 3, len(lights) + 1))
    for index, light in enumerate(lights):
        own = group == light.group
        share = light.share(frame.height)[clipped.row[own]]
        result[..., index] = means(lost[own] * share[:, None], cell[own])
    seen = np.flatnonzero(frame.opening)
    result[..., -1] = means(color[seen], grid_cells(frame, seen, rows))
    near = ~frame.opening.ravel()[clipped.texel]
    result[..., -1] += means(color[clipped.texel[near]], cell[near])
    known = group > 0
    result[..., -1] -= means(lost[known], cell[known])
    np.maximum(result, 0.0, out=result)
    return result


def _shining(
    frame: Frame,
    clipped: Clipped,
    group: NDArray[np.intp],
    lights: Sequence[Light],
    cells: Cells,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return cells (m,) on clipped surfaces, and the index (m,) of the light of each."""
    cell = grid_cells(frame, clipped.texel, cells.rows)
    texels = frame.width * frame.height / len(cells.depth)
    chosen, light_of = [], []
    for index, light in enumerate(lights):
        if light.far:
            continue
        own = (group == light.group) & (clipped.share > 0.0).any(axis=-1)
        count = np.bincount(cell[own], minlength=len(cells.depth))
        there = np.flatnonzero((count >= MOSTLY * texels) & well_seen(cells))
        there = there[:: -(-len(there) // SHINE_POINTS) or 1]
        chosen.append(there)
        light_of.append(np.full(len(there), index))
    if not chosen:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    return np.concatenate(chosen), np.concatenate(light_of).astype(np.intp)
