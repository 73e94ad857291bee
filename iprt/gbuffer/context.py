"""State of the current view frame, shared by all passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View


class ViewConstants:
    """Constants of a view, and of the previous frame's view, on the device.

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
        """Go on to the next frame; `previous` is the last one's view, if there was any.

        Returns
        -------
        bool
            Whether either differs from the last frame.
        """
        held, self._held = self._held, (view, previous)
        if held == self._held:
            return False
        # The constants of the previous view are on the device already.
        self.current, self.previous = self.previous, self.current
        self._device.write(self.current, view.kernel_constants())
        if held is None:
            self._device.write(self.previous, previous.kernel_constants())
        return True


@dataclass(frozen=True)
class FrameContext:
    """Current view frame.

    Attributes
    ----------
    index : int
        Frames since the start.
    camera, previous_camera : View
        This frame's view and the previous frame's, in the axes of the capture centre.
    view, previous : (16,) float32
        `View.kernel_constants()` of both, on the device.
    moved : bool
        Objects have moved since the previous frame.
    moving : bool
        Objects have moved since the previous frame, or did until then.
    changed : bool
        The scene differs from the previous frame's: objects or the video have moved.
    fading : float
        Least share of this frame in the temporal means of real surfaces; 0: an equal share for all
        frames.
    reflected_fading : float
        The same for reflected light.
    grids : 16 of (2,) int32
        Origins of the tracing grid, which recur after 16 frames.
    cut : bool
        The video shows another scene: accumulated state is invalid.
    """

    index: int
    camera: View
    previous_camera: View
    view: cla.Array
    previous: cla.Array
    moved: bool
    moving: bool
    changed: bool
    fading: float
    reflected_fading: float
    grids: Sequence[cla.Array]
    cut: bool = False

    @property
    def steady(self) -> bool:
        """True if neither view nor scene has moved since the previous frame, or at a cut."""
        return self.cut or (not self.changed and self.camera == self.previous_camera)

    @property
    def grid(self) -> cla.Array:
        """Origin of the tracing grid in this frame, (2,) int32."""
        return self.grids[self.index % len(self.grids)]
