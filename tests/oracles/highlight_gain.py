"""NumPy twin of the limit on computed highlights (`cl/world/real/highlight_gain.cl`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.float64]

DARKER = 0.25
"""Quantile of a material's diffuse reflectance that bounds it from below everywhere."""
FAINT = 0.25
"""Highlights up to this fraction of the captured radiance are faint: they leave the diffuse
reflectance visible, and can be separated from it only roughly."""
LEAST = 0.5
"""Least diffuse reflectance of a dark speck, relative to the material's darker parts."""
REACH = 1.5
"""Standard deviation, in cells, of the Gaussian that averages texture."""
BLURRED = round(4.0 * REACH)
"""Cells beyond which the Gaussian ends."""


def highlight_gain(
    seen: Cells, specular: Cells, irradiance: Cells, gloss: NDArray[np.integer]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the factor on the computed highlight, in [0, 1], and its least remainder per cell.

    Parameters
    ----------
    seen, specular : (rows, columns, 3)
        Means over a cell's glossy texels: captured radiance; computed highlight.
    irradiance : (rows, columns, 3)
        Over π, with the noise of few rays: averaged over 3 x 3 cells of the same material.
    gloss : (rows, columns)
        Index of their material + 1; 0: the cell has none.

    Returns
    -------
    gain : (rows, columns, 4) float32
        1 where no cell nearby has gloss. The fourth is 0.
    min_base : (rows, columns, 4) float32
        Radiance that the highlight leaves wherever the captured radiance reaches it.
    """
    gain, min_base = np.zeros((2, *gloss.shape, 4), np.float32)
    gain[..., :3] = 1.0
    # Rows far from gloss have a gain of 1.
    rows = np.flatnonzero(gloss.any(axis=1))
    if len(rows):
        near = slice(max(rows[0] - BLURRED, 0), rows[-1] + BLURRED + 1)
        parts = seen[near], specular[near], irradiance[near], gloss[near]
        gain[near, :, :3], min_base[near, :, :3] = _gain_of_rows(*parts)
    return gain, min_base


def _gain_of_rows(
    seen: Cells, specular: Cells, irradiance: Cells, gloss: NDArray[np.integer]
) -> tuple[Cells, Cells]:
    """Return gain and least remainder (rows, columns, 3); no other rows have gloss."""
    base = np.zeros(seen.shape)
    irradiance = _averaged(irradiance, gloss)
    for index in range(1, int(gloss.max(initial=0)) + 1):
        cells = (gloss == index) & (irradiance.min(axis=-1) > 0.0)
        if cells.any():
            reflectance = _reflectance(seen[cells], specular[cells], irradiance[cells])
            base[cells] = reflectance * irradiance[cells]
    inside = (gloss > 0)[..., None]
    mean, dark, computed = (
        _blurred(np.where(inside, part, 0.0)) for part in (seen, base, specular)
    )
    there = (computed > 0.0) & (mean > 0.0)
    could = np.divide(mean - dark, computed, out=np.ones(seen.shape), where=there)
    # Faint highlights are below the uncertainty of the base: they are kept.
    strength = np.divide(computed, FAINT * mean, out=np.zeros(seen.shape), where=there)
    trust = np.minimum(strength, 1.0) ** 2
    return 1.0 + trust * (np.clip(could, 0.0, 1.0) - 1.0), LEAST * base


def _averaged(irradiance: Cells, gloss: NDArray[np.integer]) -> Cells:
    """Return the mean over 3 x 3 cells of the same material; 0 where there is none."""
    mean = np.zeros(irradiance.shape)
    for index in range(1, int(gloss.max(initial=0)) + 1):
        there = (gloss == index)[..., None].astype(np.float64)
        share = _filtered(there, np.full(3, 1.0 / 3.0))
        sums = _filtered(there * irradiance, np.full(3, 1.0 / 3.0))
        mean += there * sums / np.maximum(share, 1e-9)
    return mean


def _reflectance(seen: Cells, specular: Cells, irradiance: Cells) -> Cells:
    """Return (3,) diffuse reflectance of the darker parts of a material, from its cells (N, 3)."""
    faint = specular.sum(axis=-1) <= FAINT * seen.sum(axis=-1)
    if np.count_nonzero(faint) >= 0.1 * len(seen):
        seen, specular, irradiance = seen[faint], specular[faint], irradiance[faint]
    base = np.maximum(seen - specular, 0.0) / irradiance
    return np.asarray(np.quantile(base, DARKER, axis=0, method="lower"))


def _blurred(cells: Cells) -> Cells:
    """Return the Gaussian mean."""
    weights = np.exp(-0.5 * (np.arange(-BLURRED, BLURRED + 1) / REACH) ** 2)
    return _filtered(cells, weights / weights.sum())


def _filtered(cells: Cells, weights: Cells) -> Cells:
    """Return means with these weights along both axes; they wrap around in azimuth only.

    Sums of slices, as the import of `scipy.ndimage` would take longer than the filter.
    """
    reach = len(weights) // 2
    for axis, mode in enumerate(("edge", "wrap")):
        around = [(reach, reach) if axis == one else (0, 0) for one in range(3)]
        padded = np.moveaxis(np.pad(cells, around, mode=mode), axis, 0)  # type: ignore[call-overload]
        means = np.zeros(np.moveaxis(cells, axis, 0).shape)
        for first, weight in enumerate(weights):
            means += weight * padded[first : first + len(means)]
        cells = np.moveaxis(means, 0, axis)
    return cells
