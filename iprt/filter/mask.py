"""Sparse tracing mask (IPRT, Eqs. 3 and 4): which pixels get a ray in this picture."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.signature import constant
from iprt.gbuffer.guide import Guide
from iprt.settings.features import TOUCHED_FRAMES
from iprt.settings.filter import MaskSettings

LEVEL_NONE = constant("lib/gbuffer/guide.h", "LEVEL_NONE")
"""Level of a pixel where there is nothing to trace."""

STRONG_FRAMES = 2.0 * TOUCHED_FRAMES
"""The same where an object changes much, if pixels that it changes little are told apart."""

_CHUNK = constant("filter/mask.cl", "CHUNK")


def grid_offset(frame: int) -> tuple[int, int]:
    """Origin (x, y) of the tracing grid in a frame: within 16 frames each pixel is on the grid.

    The first four offsets are the first spread over the 4 x 4 cell, as in an ordered dither.
    """
    bit = [frame >> i & 1 for i in range(4)]
    return 2 * bit[0] + bit[2], 2 * (bit[0] ^ bit[1]) + (bit[2] ^ bit[3])


class Mask:
    """Chooses tracing levels and lists the pixels that get a ray.

    Attributes
    ----------
    touched : 1 padded plane float32
        Frames for which an object's influence on the pixel is remembered, in the frames after this
        one. Tracing writes `TOUCHED_FRAMES` where a ray met an object.
    level : 1 padded plane uint8
        0, 1, 2: one ray per 1, 4, 16 pixels; `LEVEL_NONE` where there is nothing to trace.
    traced : (H * W,) int32
        y * W + x of the pixels that get a ray; the first `count` entries hold.
    count : (1,) int32
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        settings: MaskSettings,
        *,
        name: str,
        graded: bool = False,
    ):
        """`graded`: pixels touched for up to `TOUCHED_FRAMES` get one ray for four of them only."""
        self._faint_frames = TOUCHED_FRAMES if graded else 0.0
        self.settings = settings
        self._device = device
        self._guide = guide
        layout = guide.layout
        defines = guide.defines()
        self._choose = device.kernel("filter/mask.cl", "choose_level", defines)
        self._list = device.kernel("filter/mask.cl", "list_traced", defines)
        self.touched = device.zeros(f"{name} touched", layout.shape(1))
        self._before = device.zeros(f"{name} touched before", layout.shape(1))
        self.level = device.zeros(f"{name} level", layout.shape(1), np.uint8)
        self.traced = device.empty(f"{name} traced", (layout.width * layout.height,), np.int32)
        self.count = device.zeros(f"{name} traced count", (1,), np.int32)

    def run(self, offset: tuple[int, int], motion: cla.Array, *, metre: float = 1.0) -> None:
        """Fill `level`, `traced` and `count` from the guide's current picture.

        Parameters
        ----------
        offset : (int, int)
            Origin of the grid in 0..3, `grid_offset(frame)`; give it to `Interpolate.run` too.
        motion : 2 planes
            Previous position of each pixel's surface in pixels, -1e9 = nowhere.
        metre : float
            Length of a metre in the units of the guide's positions.
        """
        layout = self._guide.layout
        # Fewer than 4 pixels a side need not hold a point of the coarsest grid.
        sparse = self.settings.sparse and min(layout.size) >= 4
        self.touched, self._before = self._before, self.touched
        with self._device.profile.section("mask"):
            self._choose(
                layout.size,
                self._guide.arguments(),
                motion=motion,
                before=self._before,
                touched=self.touched,
                level=self.level,
                count=self.count,
                sigma_position=self.settings.sigma_position / metre,
                low=self.settings.low if sparse else 0.0,
                high=self.settings.high if sparse else 0.0,
                faint_frames=self._faint_frames,
            )
            self._list(
                (-(-layout.width // _CHUNK), layout.height),
                layout.arguments(),
                level=self.level,
                list=self.traced,
                count=self.count,
                offset_x=offset[0],
                offset_y=offset[1],
            )
