"""How much of a computed highlight the camera can have seen.

What a glossy floor reflects towards the capture centre, the capture centre need not see: the sky
above the window's upper edge, above all, which is extrapolated
(`iprt.footage.window_environment`) and may be several times too bright, or of another hue. The
camera's own picture of the highlight tells. A surface of one material is taken to have, in each
place, at least the diffuse reflectance of its darker parts: what the camera saw beyond that is all
that the highlight can have been.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Cells = NDArray[np.float64]

DARKER = 0.25
"""Quantile of a material's diffuse reflectance that all its places have at least."""
FAINT = 0.25
"""Highlights up to this fraction of what was seen are faint: they leave the diffuse reflectance
visible, and can be told from it only roughly."""
LEAST = 0.5
"""Even a dark speck of a material has so much of the diffuse reflectance of its darker parts."""
REACH = 1.5
"""Cells: deviation of the Gaussian that evens out texture."""


def highlight_gain(
    seen: Cells, specular: Cells, irradiance: Cells, gloss: NDArray[np.integer]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Factor on the computed highlight, in [0, 1], and what it must leave, per cell and colour.

    Parameters
    ----------
    seen, specular : (rows, columns, 3)
        Means over a cell's glossy texels: radiance that the camera saw; highlight as computed.
    irradiance : (rows, columns, 3)
        Over π.
    gloss : (rows, columns)
        Index of their material + 1; 0: the cell has none.

    Returns
    -------
    gain : (rows, columns, 4) float32
        1 where no cell near has gloss. The fourth is 0.
    min_base : (rows, columns, 4) float32
        Radiance that the highlight leaves wherever that much was seen.
    """
    base = np.zeros(seen.shape)
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
    # Faint highlights drown in what is uncertain of the base: they are believed.
    strength = np.divide(computed, FAINT * mean, out=np.zeros(seen.shape), where=there)
    trust = np.minimum(strength, 1.0) ** 2
    gain, min_base = np.zeros((2, *gloss.shape, 4), np.float32)
    gain[..., :3] = 1.0 + trust * (np.clip(could, 0.0, 1.0) - 1.0)
    min_base[..., :3] = LEAST * base
    return gain, min_base


def _reflectance(seen: Cells, specular: Cells, irradiance: Cells) -> Cells:
    """(3,) diffuse reflectance of the darker parts of a material, from cells (N, 3) of it."""
    faint = specular.sum(axis=-1) <= FAINT * seen.sum(axis=-1)
    if np.count_nonzero(faint) >= 0.1 * len(seen):
        seen, specular, irradiance = seen[faint], specular[faint], irradiance[faint]
    base = np.maximum(seen - specular, 0.0) / irradiance
    return np.asarray(np.quantile(base, DARKER, axis=0))


def _blurred(cells: Cells) -> Cells:
    """Gaussian mean; around in azimuth, not over the poles."""
    return np.asarray(
        gaussian_filter(cells, (REACH, REACH, 0), mode=("nearest", "wrap", "nearest"))
    )
