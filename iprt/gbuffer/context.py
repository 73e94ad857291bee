"""The state of the view frame that passes work on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pyopencl.array as cla


@dataclass(frozen=True)
class FrameContext:
    """The view frame that is being rendered.

    Attributes
    ----------
    index : int
        Frames since the start.
    view : (16,) float32
        `View.kernel_constants()` on the device.
    previous : (16,) float32
        The same of the frame before.
    view_changed : bool
        The view, or that of the frame before, is not what it was then.
    video_changed : bool
        The panorama is not that of the frame before.
    objects_changed : bool
        Objects moved since the frame before.
    fading : float
        Least share of this frame in the temporal means; 0: what the mean of all gives it.
    grids : 16 of (2,) int32
        Origins of the tracing grid, which recur after 16 frames.
    cut : bool
        The video shows something else: nothing that was accumulated holds.
    """

    index: int
    view: cla.Array
    previous: cla.Array
    view_changed: bool
    video_changed: bool
    objects_changed: bool
    fading: float
    grids: Sequence[cla.Array]
    cut: bool = False

    @property
    def grid(self) -> cla.Array:
        """(2,) int32: the origin of the tracing grid in this frame."""
        return self.grids[self.index % len(self.grids)]

    @property
    def changed(self) -> bool:
        """The scene is not that of the frame before."""
        return self.index > 0 and (self.video_changed or self.objects_changed)
