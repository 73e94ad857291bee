"""Sparse tracing mask (IPRT, Eqs. 3 and 4): which pixels get a ray in this picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant, float_constant
from iprt.filter.temporal import NORMAL_AGREEMENT, PLANE_TOLERANCE
from iprt.gbuffer.batch import batched
from iprt.gbuffer.guide import Guide, tile_arguments
from iprt.gbuffer.tiles import TILE
from iprt.settings.features import TOUCHED_FRAMES
from iprt.settings.filter import MaskSettings

LEVEL_WAITING = constant("lib/gbuffer/guide.h", "LEVEL_WAITING")
"""Level of a pixel of level 0 that waits for its turn."""

LEVEL_NONE = constant("lib/gbuffer/guide.h", "LEVEL_NONE")
"""Level of a pixel with nothing to trace."""

STRONG_FRAMES = float_constant("lib/gbuffer/guide.h", "STRONG_FRAMES")
"""Frames, including the traced one, for which a strong influence of an object is remembered, if
weakly affected pixels are distinguished."""

LOW, HIGH = 0.3, 0.5
"""δ1 and δ2 of IPRT's Eq. 4: pixels that differ less get one ray for 16, and for 4."""


def grid_offset(frame: int) -> tuple[int, int]:
    """Return the origin (x, y) of the tracing grid in a frame.

    Within 16 frames each pixel is on the grid. The first four offsets are spread over the 4 x 4
    cell, as in an ordered dither.
    """
    bit = [frame >> i & 1 for i in range(4)]
    return 2 * bit[0] + bit[2], 2 * (bit[0] ^ bit[1]) + (bit[2] ^ bit[3])


def tracing_grids(device: ComputeDevice) -> list[cla.Array]:
    """Return `grid_offset` of 16 frames as (2,) int32 each.

    Buffers cost less to bind than numbers.
    """
    return [
        device.upload(f"tracing grid {i}", np.array(grid_offset(i), np.int32)) for i in range(16)
    ]


class Mask:
    """Tracing levels of a layer, and the list of its pixels that get a ray. `Masks` fills it.

    Attributes
    ----------
    touched : 1 padded plane float32
        Frames for which an object's influence on the pixel is remembered, from this one on. Tracing
        writes `TOUCHED_FRAMES` where a ray met an object.
    before : 1 padded plane float32
        The same of the last picture.
    level : 1 padded plane uint8
        0, 1, 2: one ray per 1, 4, 16 pixels; `LEVEL_WAITING`, `LEVEL_NONE`.
    traced : (H * W,) int32
        y * W + x of the pixels that get a ray; the first `count` entries are valid.
    count : (1,) int32
    low, high, faint_frames : float
        Thresholds of `cl/filter/mask.cl`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        settings: MaskSettings,
        *,
        name: str,
        graded: bool = False,
    ) -> None:
        """Create the buffers.

        `graded`: pixels touched for up to `TOUCHED_FRAMES` get only one ray for four of them.
        """
        self.settings = settings
        self.guide = guide
        layout = guide.layout
        # A picture of fewer than 4 pixels a side may miss the coarsest grid.
        sparse = settings.sparse and min(layout.size) >= 4
        self.low, self.high = (LOW, HIGH) if sparse else (0.0, 0.0)
        self.faint_frames = TOUCHED_FRAMES - 1.0 if graded else 0.0
        # Nothing is known of surfaces that come into view: each pixel gets a ray, once.
        self.unseen = -1.0 if graded else 0.0
        self.touched = device.zeros(f"{name} touched", layout.shape(1))
        self.before = device.zeros(f"{name} touched before", layout.shape(1))
        self.level = device.upload(f"{name} level", np.full(layout.shape(1), LEVEL_NONE, np.uint8))
        self.traced = device.empty(f"{name} traced", (layout.width * layout.height,), np.int32)
        self.count = device.zeros(f"{name} traced count", (1,), np.int32)


class Masks:
    """Tracing levels of the layers of a view, and the lists of pixels that get a ray."""

    def __init__(self, device: ComputeDevice, masks: Sequence[Mask]) -> None:
        self._masks = masks
        defines = masks[0].guide.defines()
        size = masks[0].guide.layout.arguments()
        tiles = tile_arguments([mask.guide for mask in masks])
        guide = masks[0].guide
        self._carry = device.kernel(
            "filter/mask.cl", "carry_touched", {**defines, **guide.camera_define}
        ).fixed(
            size,
            tiles,
            guide.camera_argument,
            batched(unseen=[mask.unseen for mask in masks]),
            normal_agreement=NORMAL_AGREEMENT,
        )
        listed = batched(
            level=[mask.level for mask in masks],
            count=[mask.count for mask in masks],
        )
        self._choose = device.kernel("filter/mask.cl", "choose_level", defines).fixed(
            size,
            tiles,
            listed,
            batched(
                low=[mask.low for mask in masks],
                high=[mask.high for mask in masks],
                faint_frames=[mask.faint_frames for mask in masks],
            ),
        )
        self._list = device.kernel("filter/mask.cl", "list_traced", defines).fixed(
            size, tiles, listed, batched(list=[mask.traced for mask in masks])
        )

    def run(
        self,
        grid: cla.Array,
        motions: Sequence[cla.Array],
        histories: Sequence[cla.Array | None] | None = None,
        *,
        metre: float = 1.0,
        cut: bool = False,
    ) -> None:
        """Fill `level`, `traced` and `count` of each from the current picture of its guide.

        Parameters
        ----------
        grid : (2,) int32
            Origin of the tracing grid, `FrameContext.grid`, the same as for `Interpolate.run`.
        motions : 2 planes each
            Previous position of each pixel's surface in pixels, -1e9 = nowhere.
        histories : 2 planes or None each, optional
            `Temporal.certainties` after the last picture. With them, pixels of sparse masks with a
            long history get fewer rays.
        metre : float
            Length of a metre in the units of the guide's positions.
        cut : bool
            The last picture showed another place, or other light.
        """
        masks = self._masks
        tiles = masks[0].guide.tiles
        certainties = histories or [None] * len(masks)
        for mask in masks:
            mask.touched, mask.before = mask.before, mask.touched
        size = tiles.lanes(len(masks))
        carried = batched(
            guide=[mask.guide.current for mask in masks],
            motion=motions,
            touched=[mask.touched for mask in masks],
        )
        self._carry(
            size,
            carried,
            batched(
                guide_previous=[mask.guide.previous for mask in masks],
                before=[mask.before for mask in masks],
            ),
            plane_tolerance=-1.0 if cut else PLANE_TOLERANCE,
        )
        self._choose(
            size,
            carried,
            batched(
                # Without a history another plane is bound, which is not used.
                certainty=[
                    mask.before if certainty is None else certainty
                    for mask, certainty in zip(masks, certainties, strict=True)
                ],
                keep=[
                    certainty is not None and mask.settings.sparse
                    for mask, certainty in zip(masks, certainties, strict=True)
                ],
                sigma_position=[mask.settings.sigma_position / metre for mask in masks],
            ),
            origin=grid,
        )
        self._list((TILE, tiles.across * tiles.down, len(masks)), origin=grid)
