"""Change of light on static surfaces between two video frames, in cells of an equirect grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import LUMINANCE

if TYPE_CHECKING:
    from iprt.world.real.panorama import Panorama

TEXELS = 4
"""Samples per side of a cell, about: more add no information."""
DARK = 1e-2
"""Radiance, relative to the panorama's mean, below which a cell is only noise."""
DISTRUST = 0.5
"""Share of a change that may have other causes than light: highlights, screens, noise."""


class CellLight:
    """Light samples of two frames, and the change between them.

    The radiance of a diffuse surface is proportional to its irradiance, so both change by one
    factor. It is measured on texels whose surface stayed.

    Parameters
    ----------
    width, height : int
        Size of the panorama.
    rows : int
        Rows of the grid, which has twice as many columns.
    """

    def __init__(self, device: ComputeDevice, width: int, height: int, rows: int) -> None:
        self._device = device
        step = max(1, height // (TEXELS * rows))
        self._rows = rows
        self._shape = (-(-height // step), -(-width // step), 4)
        self._now, self._before = (
            device.zeros(f"light samples {i}", self._shape) for i in range(2)
        )
        self._lights = device.empty("irradiance light sums", (2 * rows * rows, 2, 4))
        self._sample = device.kernel("world/real/cell_light.cl", "sample_light").fixed(
            width=width, step=step, sample_columns=self._shape[1], sample_rows=self._shape[0]
        )
        self._compare = device.kernel(
            "world/real/cell_light.cl", "compare_light", later=True
        ).fixed(
            columns=2 * rows,
            rows=rows,
            width=width,
            height=height,
            step=step,
            sample_columns=self._shape[1],
            lights=self._lights,
        )

    def follow(self, panorama: Panorama) -> None:
        """Sample the frame that the panorama holds."""
        self._now, self._before = self._before, self._now
        rows, columns, _ = self._shape
        self._sample(
            (columns, rows),
            radiance=panorama.radiance,
            inverse=panorama.surfaces.inverse,
            lines=panorama.surfaces.lines,
            samples=self._now,
        )

    def change(self, changed: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the factor of the irradiance per cell, and its relative error.

        The change is from the previous to the last frame, both with the same capture centre.

        Parameters
        ----------
        changed : float
            Share of the panorama's flux that changed: the error where it is too dark to measure.

        Returns
        -------
        factor : (rows * 2 * rows, 3) float32
        error : (rows * 2 * rows,) float32
        """
        size = (2 * self._rows, self._rows)
        self._compare(size, before=self._before, now=self._now)
        sums = self._device.read(self._lights).astype(np.float64)
        return light_change(sums[:, 0, :3], sums[:, 1, :3], sums[:, 0, 3], changed)


def light_change(
    before: NDArray[np.float64],
    now: NDArray[np.float64],
    count: NDArray[np.float64],
    changed: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return `CellLight.change` from sums (cells, 3) of radiance over (cells,) samples."""
    lights = [sums / np.maximum(count, 1.0)[:, None] for sums in (before, now)]
    dark = DARK * float(np.mean(lights)) + 1e-30
    factor = (lights[1] + dark) / (lights[0] + dark)
    shown = [mean @ LUMINANCE + dark for mean in lights]
    unknown = dark / np.minimum(*shown)
    error = DISTRUST * np.abs(np.log(shown[1] / shown[0])) * (1.0 - unknown) + changed * unknown
    return factor.astype(np.float32), error.astype(np.float32)
