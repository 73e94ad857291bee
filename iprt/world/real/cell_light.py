"""Change of light on static surfaces between two video frames, in cells of an equirect grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice

if TYPE_CHECKING:
    from iprt.world.real.panorama import Panorama

TEXELS = 4
"""Samples per side of a cell, about: more add no information."""
DARK = 1e-2
"""Radiance, relative to the panorama's mean, below which a cell is only noise."""


class CellLight:
    """Light samples of two frames, whose change relights the irradiance cache.

    See `cl/world/real/cell_light.cl`.

    Parameters
    ----------
    width, height : int
        Size of the panorama.
    rows : int
        Rows of the grid, which has twice as many columns.
    """

    def __init__(self, device: ComputeDevice, width: int, height: int, rows: int) -> None:
        step = max(1, height // (TEXELS * rows))
        self._size = (2 * rows, rows)
        self._shape = (-(-height // step), -(-width // step), 4)
        self._now, self._before = (
            device.zeros(f"light samples {i}", self._shape) for i in range(2)
        )
        self._sample = device.kernel("world/real/cell_light.cl", "sample_light").fixed(
            width=width, step=step, sample_columns=self._shape[1], sample_rows=self._shape[0]
        )
        self._relight = device.kernel(
            "world/real/cell_light.cl", "relight_cells", later=True
        ).fixed(
            columns=2 * rows,
            rows=rows,
            width=width,
            height=height,
            step=step,
            sample_columns=self._shape[1],
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

    def relight(
        self,
        panorama: Panorama,
        changed: float,
        *,
        plane: cla.Array,
        mean: cla.Array,
        smooth: cla.Array,
    ) -> None:
        """Scale irradiance by the change from the previous to the last frame.

        Both frames have the same capture centre. A cell keeps at most as many samples as correspond
        to the change's relative error.

        Parameters
        ----------
        changed : float
            Share of the panorama's flux that changed: the error where it is too dark to measure.
        plane, mean, smooth
            Of the `IrradianceCache`.
        """
        self._relight(
            self._size,
            dark=DARK * panorama.mean_radiance + 1e-30,
            changed=changed,
            before=self._before,
            now=self._now,
            plane=plane,
            mean=mean,
            smooth=smooth,
        )
