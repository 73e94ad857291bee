"""How light on still surfaces changed between two video frames, by cells of an equirect grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import LUMINANCE, Frame

TEXELS = 4
"""A cell has at most so many per side: more say nothing new."""
SAME_DISTANCE = 0.02
"""Relative distance up to which a texel's surface is the one it was."""
DARK = 1e-2
"""Radiance over the panorama's mean below which a cell is noise and no light."""
DISTRUST = 0.5
"""Share of a change that may be none of the light: highlights, screens, noise."""


def light_change(
    before: Frame, now: Frame, rows: int, changed: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Factor of the irradiance per cell, and the relative error of that.

    What a diffuse surface sends is in proportion to its irradiance, so that both change by one
    factor. It is measured on texels whose surface stayed.

    Parameters
    ----------
    before, now : Frame
        Both of one size, from the same capture centre.
    rows : int
        Rows of the grid, which has twice as many columns.
    changed : float
        Share of the panorama's flux that changed: the error where it is too dark to tell.

    Returns
    -------
    factor : (rows * 2 * rows, 3) float32
    error : (rows * 2 * rows,) float32
    """
    height, width = now.depth.shape
    step = max(1, height // (TEXELS * rows))
    row = np.arange(0, height, step) * rows // height
    column = np.arange(0, width, step) * 2 * rows // width
    cell = (row[:, None] * 2 * rows + column).ravel()
    depths = (frame.depth[::step, ::step] for frame in (before, now))
    with np.errstate(invalid="ignore"):
        first, second = depths
        same = (np.abs(second - first) <= SAME_DISTANCE * second).ravel()

    def light(frame: Frame) -> NDArray[np.float64]:
        texels = frame.radiance[::step, ::step].reshape(-1, 3)[same]
        sums = [np.bincount(cell[same], texels[:, c], 2 * rows * rows) for c in range(3)]
        return (
            np.stack(sums, -1)
            / np.maximum(np.bincount(cell[same], minlength=2 * rows * rows), 1)[:, None]
        )

    lights = [light(frame) for frame in (before, now)]
    dark = DARK * float(np.mean(lights)) + 1e-30
    factor = (lights[1] + dark) / (lights[0] + dark)
    shown = [mean @ LUMINANCE + dark for mean in lights]
    unknown = dark / np.minimum(*shown)
    error = DISTRUST * np.abs(np.log(shown[1] / shown[0])) * (1.0 - unknown) + changed * unknown
    return factor.astype(np.float32), error.astype(np.float32)
