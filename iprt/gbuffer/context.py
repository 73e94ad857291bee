"""The state of the view frame that passes work on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View


class ViewConstants:
    """The constants of a view, and of that of the frame before, on the device.

    Attributes
    ----------
    current, previous : (16,) float32
        `View.kernel_constants()`.
    """

    def __init__(self, device: ComputeDevice, name: str) -> None:
        self._device = device
        self.current, self.previous = (device.zeros(f"{name} {i}", (16,)) for i in range(2))
        self._held: tuple[View, View] | None = None

    def follow(self, view: View, previous: View) -> bool:
        """Go on to the next frame; `previous` was the view of the last one, if there was any.

        Returns
        -------
        bool
            Either differs from what it was in the last frame.
        """
        held, self._held = self._held, (view, previous)
        if held == self._held:
            return False
        # What was the view in the frame before is on the device.
        self.current, self.previous = self.previous, self.current
        self._device.write(self.current, view.kernel_constants())
        if held is None:
            self._device.write(self.previous, previous.kernel_constants())
        return True


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
