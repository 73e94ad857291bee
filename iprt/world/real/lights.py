"""Table for light sampling: rays aimed at the bright parts of the panorama."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla

from iprt.device.block import Block, Float2, Floats, Int32
from iprt.device.compute import ComputeDevice
from iprt.device.vectors import float2
from iprt.geometry.equirect import solid_angles

LIGHT_ROWS = 256
"""Most rows of the table: cells of 0.7 degrees."""


@dataclass(kw_only=True)
class LightsArgs(Block):
    """Light sampling table (`cl/lib/world/real/lights.h`); by default empty.

    Attributes
    ----------
    column : (columns + 1,) float32
        Share of the light in the columns of cells before each; 0 everywhere in even light.
    share : (rows, columns) float32
        Share of a column's light in its cells down to each row.
    density : (rows, columns) float32
        1/sr about the capture centre.
    columns, rows : int
    size : float2
        Columns and rows: see `GridArgs`.
    """

    column: Floats = None
    share: Floats = None
    density: Floats = None
    columns: Int32 = 1
    rows: Int32 = 1
    size: Float2 = None

    def __post_init__(self) -> None:
        self.size = float2(self.columns, self.rows)


class Lights:
    """Densities of directions about the capture centre, for `cl/lib/world/real/lights.h`.

    They are proportional to the excess of cells' luminance over the mean. BRDF sampling is better
    for even light, so the mean is subtracted (*MIS compensation*, Karlík et al., "MIS Compensation:
    Optimizing Sampling Techniques in Multiple Importance Sampling", SIGGRAPH Asia 2019).

    Attributes
    ----------
    rows, columns : int
    luminance : (rows, columns) float32
        Means over the cells.
    """

    def __init__(
        self, device: ComputeDevice, width: int, height: int, *, name: str = "light"
    ) -> None:
        self.rows, self.columns = min(LIGHT_ROWS, height), min(2 * LIGHT_ROWS, width)
        grid, line = (self.rows, self.columns), (self.columns,)
        self.luminance = device.empty(f"{name} luminance", grid)
        self._column = device.zeros(f"{name} columns", (self.columns + 1,))
        self._share = device.zeros(f"{name} shares", grid)
        self._density = device.zeros(f"{name} density", grid)
        solid_angle = solid_angles(self.columns, self.rows).astype(np.float32)
        known = {
            "columns": self.columns,
            "rows": self.rows,
            "luminance": self.luminance,
            "solid_angle": device.upload(f"{name} solid angles", solid_angle),
            "light": device.empty(f"{name} of columns", line),
            "excess": device.empty(f"{name} excess", line),
            "density": self._density,
            "share": self._share,
            "column": self._column,
        }
        file = "world/real/lights.cl"
        self._sum = device.kernel(file, "sum_luminance").fixed(known, mean=self.luminance)
        steps = ("sum_columns", "find_excess", "make_lights")
        self._steps = [device.kernel(file, step).fixed(known) for step in steps]

    def load(self, radiance: cla.Array, hidden: cla.Array | None = None) -> None:
        """Build the table of a panorama (H, W, 3), linear radiance.

        `hidden` (H, W) is the luminance of lights in the hidden background, else 0.
        """
        height, width, _ = radiance.shape
        self._sum(
            (self.columns, self.rows),
            width=width,
            height=height,
            texels=radiance,
            hidden_light=hidden,
        )
        for step in self._steps:
            step((self.columns,))

    def arguments(self) -> LightsArgs:
        """Return the table for rays."""
        return LightsArgs(
            column=self._column,
            share=self._share,
            density=self._density,
            columns=self.columns,
            rows=self.rows,
        )
