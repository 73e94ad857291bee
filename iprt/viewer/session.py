"""The session of one client: renderers that follow the newest request."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.profile import PassTime
from iprt.renderer import RenderedFrame
from iprt.viewer.accumulating_renderer import AccumulatingRenderer, Stage
from iprt.viewer.compiling import Compiling
from iprt.viewer.state import Request
from iprt.viewer.visible_surfaces import Geometry
from iprt.world.shared import Worlds


@dataclass(frozen=True, eq=False)
class Shown:
    """A finished picture.

    Attributes
    ----------
    number : int
        Number of the newest request or change that it answers; it answers all earlier ones too.
    step : int
        Number of view frames rendered for this client so far.
    request : Request
        The answered request.
    frame : int
        Number of the video frame.
    picture : RenderedFrame
    pose : (4, 4) float64 or None
        Transform from the capture centre's axes to the world; None for the identity.
    geometry : Geometry or None
        Visible surfaces at rest, if requested.
    frames : int
        Number of view frames since the last motion, which the picture averages.
    noise : float or None
        See `iprt.convergence`; None if unknown.
    passes : tuple of PassTime
        Passes of the last view frame; empty if it was not profiled (`Profile.every_s`).
    seconds : float
        Time of the picture, transfers included.
    device : str
        Name of the device.
    compiled : bool
        True if kernels were compiled or buffers created, so that later pictures are faster.
    plain : bool
        True for the video without objects, shown before the first picture. It answers no request:
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
        """True if the picture is complete: it stays until another request."""
        return self.frames >= self.request.frames


class AbandonedError(Exception):
    """The picture under way is obsolete."""


KEPT = 2
"""Renderers that a session keeps: for motion and for rest, which may differ in size and
settings."""


class Session:
    """The rendering session of one client.

    Parameters
    ----------
    compiling : Compiling
        Counter of pending compilations.
    worlds : Worlds
        Worlds of the device, shared by all sessions.
    make_room : callable
        Called before a renderer is made, with the device, the number of pixels, and the bytes that
        the renderer needs. It may `shed` renderers.
    """

    def __init__(
        self,
        compiling: Compiling,
        worlds: Worlds,
        make_room: Callable[[ComputeDevice, int, int], object],
    ) -> None:
        self._compiling, self._worlds, self._make_room = compiling, worlds, make_room
        self._renderers: list[AccumulatingRenderer] = []  # most recently used first
        self._changing: AccumulatingRenderer | None = None  # the renderer of the frame under way
        self._shown_stage: Stage | None = None
        self._shown_number: int | None = None
        self._last: Shown | None = None
        self._steps = 0

    def behind(self, stage: Stage, number: int) -> bool:
        """Return True if the last picture shows another stage or answers another request."""
        return stage is not self._shown_stage or number != self._shown_number

    def shows(self, stage: Stage) -> bool:
        """Return True if the last picture shows the video frame of this stage."""
        shown = self._shown_stage
        return shown is not None and shown.frame is stage.frame

    def unrefined(self, request: Request) -> bool:
        """Return True if the picture may still gain from another view frame."""
        return self._last is None or self._last.frames < request.frames

    def close(self) -> None:
        """Release the renderers; the next `render` creates new ones."""
        while self.shed():
            pass
        self._shown_stage = self._shown_number = self._last = None

    def shed(self, like: int | None = None) -> bool:
        """Close the renderer that was used longest ago; return False if there is none.

        The last picture stays. `like`: only a renderer of about as many pixels, half to twice.
        """
        for renderer in reversed(self._renderers):
            if like is None or like <= 2 * renderer.pixels <= 4 * like:
                self._renderers.remove(renderer)
                renderer.close()
                return True
        return False

    def render(self, device: ComputeDevice, stage: Stage, number: int, request: Request) -> Shown:
        """Render a view frame of the current request, accumulated on valid earlier ones.

        Raises
        ------
        IprtError
            The request cannot be rendered. The session must be closed then.
        AbandonedError
            The picture is obsolete, and the renderer it was made with is closed.
        """
        begin = time.perf_counter()
        known = self._renderers[0] if self._renderers else None
        self._changing = None
        request, last = request.at(stage.time_s), self._last
        same = stage is self._shown_stage and last is not None and request == last.request
        if same and last is not None and last.refined and not self._renderers:
            self._shown_number = number  # its renderer was shed
            return replace(last, number=max(stage.number, number))
        try:
            renderer = self._renderer(device, stage, request)
            # A request for other buffers alone needs no rendering.
            steps = 1 if renderer.rested < request.frames else 0
            if not self._compiling.built:
                self._compiling.pause()  # else drivers compile at the first launch
            device.profile.reset()
            picture = renderer.paint(steps, request.aovs)
            geometry = renderer.geometry(request.frames) if request.geometry else None
        except AbandonedError:
            self._drop_changing()
            raise
        device.finish()
        compiled = renderer is not known or self._compiling.built > 0
        self._compiling.finish()
        self._steps += steps
        self._shown_stage, self._shown_number = stage, number
        self._last = Shown(
            max(stage.number, number),
            self._steps,
            request,
            stage.frame.index,
            picture,
            stage.frame.pose,
            geometry,
            renderer.rested,
            renderer.noise,
            tuple(device.profile.passes()),
            time.perf_counter() - begin,
            device.name,
            compiled,
        )
        return self._last

    def _drop_changing(self) -> None:
        """Close the renderer of an abandoned frame, whose histories are half updated."""
        if self._changing is not None:
            self._renderers.remove(self._changing)
            self._changing.close()

    def _renderer(
        self, device: ComputeDevice, stage: Stage, request: Request
    ) -> AccumulatingRenderer:
        """Return a renderer for the request: a kept one if it can follow, or a new one."""
        instances, view, kept = stage.instances, request.view, self._renderers
        if request.objects is not None:
            instances = tuple(i for i in instances if i.name in request.objects)
        settings = request.settings or stage.settings
        stage = replace(stage, instances=instances, settings=settings)
        found = next((known for known in kept if known.serves(device, stage, view)), None)
        if found is not None:
            kept.remove(found)
            kept.insert(0, found)
            self._changing = found
            found.follow(stage, view)
            return found
        # Keep only renderers that differ in size and settings, as only those may be needed again.
        while len(kept) >= KEPT:
            self.shed()
        made = AccumulatingRenderer(
            device,
            stage,
            view,
            self._worlds,
            self._compiling.expect,
            partial(self._make_room, device, view.width * view.height),
        )
        kept.insert(0, made)
        self._changing = made
        return made
