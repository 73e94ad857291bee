"""One client's session: renderers that follow the newest request."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.profile import PassTime
from iprt.renderer import RenderedFrame
from iprt.viewer.canvas import Canvas, Stage, Wanted
from iprt.viewer.compiling import Compiling
from iprt.viewer.geometry import Geometry
from iprt.viewer.state import Request
from iprt.world.shared import Worlds


@dataclass(frozen=True, eq=False)
class Shown:
    """A finished picture.

    Attributes
    ----------
    number : int
        It answers what was asked with this number and all before.
    step : int
        View frames that were rendered for this client so far.
    request : Request
        What it shows.
    frame : int
        Number of the video's frame.
    picture : RenderedFrame
    pose : (4, 4) float64 or None
        World from the capture centre's axes; None: they are the same.
    geometry : Geometry or None
        If it was asked for, at rest.
    frames : int
        View frames for which nothing has moved, this one included: what the picture is a mean of.
    noise : float or None
        See `iprt.convergence`. None: not known yet.
    passes : tuple of PassTime
        Passes of the last view frame; none if it was not recorded (`Profile.every_s`).
    seconds : float
        That it took, transfers included.
    device : str
        What rendered it.
    compiled : bool
        Kernels were compiled or buffers made for it: the next ones will be quicker.
    plain : bool
        It is the video without objects, to look at while kernels compile. It answers no request:
        `number` is -1, and `frames` 0.
    """

    number: int
    step: int
    request: Request
    frame: int
    picture: RenderedFrame
    pose: NDArray[np.float64] | None
    geometry: Geometry | None
    frames: int
    noise: float | None
    passes: tuple[PassTime, ...]
    seconds: float
    device: str
    compiled: bool
    plain: bool = False

    @property
    def refined(self) -> bool:
        """It stays as it is until something else is asked for."""
        return self.frames >= self.request.frames


class AbandonedError(Exception):
    """The picture under way is not wanted any more."""


KEPT = 2
"""Renderers that a session keeps: of the picture in motion and of that at rest, which may differ in
size and settings."""


class Session:
    """Renders for one client.

    Parameters
    ----------
    compiling : Compiling
        Counts what will be compiled, until all is there.
    worlds : Worlds
        Those of the device, which all sessions share.
    """

    def __init__(self, compiling: Compiling, worlds: Worlds) -> None:
        self._compiling, self._worlds = compiling, worlds
        self._canvases: list[Canvas] = []  # the last one used comes first
        self._changing: Canvas | None = None  # by the frame under way
        self._shown_stage: Stage | None = None
        self._shown_number: int | None = None
        self._steps = 0

    def behind(self, stage: Stage, number: int) -> bool:
        """The last picture is not of this stage, or not of the request with this number."""
        return stage is not self._shown_stage or number != self._shown_number

    def shows(self, stage: Stage) -> bool:
        """The last picture is of the frame of this stage."""
        shown = self._shown_stage
        return shown is not None and shown.frame is stage.frame

    def unrefined(self, request: Request) -> bool:
        """The picture would gain from another view frame, as far as was asked for."""
        return not self._canvases or self._canvases[0].rested < request.frames

    def close(self) -> None:
        """Release the renderers; the next `render` makes others."""
        for canvas in self._canvases:
            canvas.close()
        self._canvases.clear()
        self._shown_stage = self._shown_number = None

    def render(self, device: ComputeDevice, stage: Stage, number: int, request: Request) -> Shown:
        """A view frame of what is wanted now, on top of those before, where these are still true.

        Raises
        ------
        IprtError
            What is wanted cannot be rendered. The session is to be closed then.
        AbandonedError
            Nobody wants the picture any more; what it was made from is gone.
        """
        begin = time.perf_counter()
        known = self._canvases[0] if self._canvases else None
        self._changing = None
        try:
            canvas = self._canvas(device, stage, request)
            # Where only other buffers are asked for, nothing needs to be rendered.
            steps = 1 if canvas.rested < request.frames else 0
            if not self._compiling.built:
                self._compiling.pause()  # else drivers compile at the first launch
            device.profile.reset()
            picture = canvas.paint(steps, request.aovs)
            geometry = canvas.geometry(request.frames) if request.geometry else None
        except AbandonedError:
            self._drop_changing()
            raise
        device.finish()
        compiled = canvas is not known or self._compiling.built > 0
        self._compiling.finish()
        self._steps += steps
        self._shown_stage, self._shown_number = stage, number
        return Shown(
            max(stage.number, number),
            self._steps,
            request,
            stage.frame.index,
            picture,
            stage.frame.pose,
            geometry,
            canvas.rested,
            canvas.noise,
            tuple(device.profile.passes()),
            time.perf_counter() - begin,
            device.name,
            compiled,
        )

    def _drop_changing(self) -> None:
        """Close the canvas of an abandoned frame: its histories are half of that frame's."""
        if self._changing is not None:
            self._canvases.remove(self._changing)
            self._changing.close()

    def _canvas(self, device: ComputeDevice, stage: Stage, request: Request) -> Canvas:
        """One that shows what is wanted: one that was kept, if it can go there."""
        instances = stage.instances
        if request.objects is not None:
            instances = tuple(i for i in instances if i.name in request.objects)
        wanted = Wanted(stage, instances, request.view, request.settings or stage.settings)
        for canvas in self._canvases:
            if canvas.serves(device, wanted):
                self._canvases.remove(canvas)
                self._canvases.insert(0, canvas)
                self._changing = canvas
                canvas.follow(wanted)
                return canvas
        # Only what differs in size and settings may be wanted again.
        for canvas in self._canvases[KEPT - 1 :]:
            canvas.close()
        del self._canvases[KEPT - 1 :]
        canvas = Canvas(device, wanted, self._worlds, self._compiling.expect)
        self._canvases.insert(0, canvas)
        self._changing = canvas
        return canvas
