"""What one client sees: a renderer that follows the newest request, and starts anew if it must."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from iprt.device.compute import ComputeDevice
from iprt.device.profile import PassTime
from iprt.errors import SceneError
from iprt.memory import require_memory
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.footage import Footage
from iprt.scene.frame import Frame
from iprt.scene.mesh import Instance, require_same_objects, same_places
from iprt.scene.objects import SceneObject
from iprt.settings import Settings
from iprt.viewer.convergence import Convergence
from iprt.viewer.geometry import Geometry
from iprt.viewer.state import Request


@dataclass(frozen=True, eq=False)
class Stage:
    """All that there is to see; another one as soon as anything of it changes.

    Attributes
    ----------
    number : int
        Of the newest change to the world that it shows.
    frame : Frame
    objects : tuple of SceneObject
    instances : tuple of Instance
        The objects, where they are in that frame.
    footage : Footage
    settings : Settings
    """

    number: int
    frame: Frame
    objects: tuple[SceneObject, ...]
    instances: tuple[Instance, ...]
    footage: Footage
    settings: Settings


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
    geometry : Geometry or None
        If it was asked for.
    frames : int
        View frames for which nothing has moved, this one included: what the picture is a mean of.
    noise : float or None
        Estimated error relative to the mean luminance (`Convergence`). None: not known yet.
    passes : tuple of PassTime
        Of the last view frame.
    seconds : float
        That it took, transfers included.
    device : str
        What rendered it.
    """

    number: int
    step: int
    request: Request
    frame: int
    picture: RenderedFrame
    geometry: Geometry | None
    frames: int
    noise: float | None
    passes: tuple[PassTime, ...]
    seconds: float
    device: str

    @property
    def refined(self) -> bool:
        """It stays as it is until something else is asked for."""
        return self.frames >= self.request.frames


class Session:
    """Renders for one client.

    Parameters
    ----------
    compiling : callable
        Called with the name of a file of `cl/` whose kernels are compiled now, and with None when
        the device renders again.
    """

    def __init__(self, compiling: Callable[[str | None], None]) -> None:
        self._compiling = compiling
        self._renderer: Renderer | None = None
        self._device: ComputeDevice | None = None
        self._footage: Footage | None = None
        self._shown_stage: Stage | None = None
        self._shown_number: int | None = None
        self._geometry: Geometry | None = None
        self._convergence = Convergence()
        self._steps = 0
        self._rested = 0
        self._moved = False  # since the renderer was made

    def behind(self, stage: Stage, number: int) -> bool:
        """The last picture is not of this stage, or not of the request with this number."""
        return stage is not self._shown_stage or number != self._shown_number

    def unrefined(self, request: Request) -> bool:
        """The picture would gain from another view frame, as far as was asked for."""
        return self._rested < request.frames

    def close(self) -> None:
        """Release the renderer; the next `render` makes another."""
        renderer, self._renderer = self._renderer, None
        self._device = self._shown_stage = self._shown_number = self._geometry = None
        if renderer is not None:
            renderer.close()

    def render(self, device: ComputeDevice, stage: Stage, number: int, request: Request) -> Shown:
        """A view frame of what is wanted now, on top of those before, where these are still true.

        Raises
        ------
        IprtError
            What is wanted cannot be rendered. The session is to be closed then.
        """
        begin = time.perf_counter()
        built = len(device.built_programs)
        renderer = self._follow(device, stage, request)
        # A fresh renderer that nothing disturbs averages all frames. What was accumulated in
        # motion is blurred by it, and must go: until the frames at rest weigh as much, as in
        # motion, and then by their plain mean, so that nothing jumps.
        at_rest = 1.0 / (self._rested + 1) if self._moved else 0.0
        renderer.fading = min(renderer.settings.fading, at_rest)
        # Where only other buffers are asked for, nothing needs to be rendered.
        steps = 1 if self._rested < max(request.frames, 1) else 0
        if len(device.built_programs) == built:
            self._compiling(None)  # else drivers compile at the first launch
        device.profile.reset()
        picture = renderer.render(steps, request.aovs)
        if request.geometry and (self._geometry is None or self._rested == 0):
            self._geometry = Geometry.of(renderer, renderer.instances)
        device.finish()
        self._compiling(None)
        self._steps += steps
        self._rested += steps
        self._shown_stage, self._shown_number = stage, number
        return Shown(
            max(stage.number, number),
            self._steps,
            request,
            stage.frame.index,
            picture,
            self._geometry if request.geometry else None,
            self._rested,
            self._convergence.add(self._rested, picture.color),
            tuple(device.profile.passes()),
            time.perf_counter() - begin,
            device.name,
        )

    def _follow(self, device: ComputeDevice, stage: Stage, request: Request) -> Renderer:
        """The renderer, brought to what is wanted: the same one if it can go there."""
        wanted = stage.instances
        if request.objects is not None:
            wanted = tuple(i for i in wanted if i.name in request.objects)
        settings = stage.settings
        if request.method is not None:
            settings = settings.model_copy(update={"method": request.method})
        renderer = self._renderer
        if renderer is None or not self._serves(device, stage, request, wanted, settings):
            return self._renewed(device, stage, request, wanted, settings)
        changed = False
        if stage.frame is not renderer.frame:
            renderer.load(stage.frame)
            changed = True
        if not same_places(renderer.instances, wanted):
            renderer.move(wanted)
            changed = True
        if request.view != renderer.view:
            renderer.look(request.view)
            changed = True
        if changed:
            self._rested, self._moved, self._geometry = 0, True, None
        return renderer

    def _serves(
        self,
        device: ComputeDevice,
        stage: Stage,
        request: Request,
        instances: tuple[Instance, ...],
        settings: Settings,
    ) -> bool:
        """Whether the renderer can go on: what it cannot follow needs other kernels or buffers."""
        renderer = self._renderer
        assert renderer is not None
        now, then = request.view, renderer.view
        if (now.width, now.height, now.projection) != (then.width, then.height, then.projection):
            return False
        if device is not self._device or settings != renderer.settings:
            return False
        if stage.footage != self._footage or not _same_kind(stage.frame, renderer.frame):
            return False
        try:
            require_same_objects(renderer.instances, instances)
        except SceneError:
            return False
        return True

    def _renewed(
        self,
        device: ComputeDevice,
        stage: Stage,
        request: Request,
        instances: tuple[Instance, ...],
        settings: Settings,
    ) -> Renderer:
        self.close()
        given = (device, stage.frame, instances, request.view, settings)
        require_memory(*given, stage.footage)
        self._renderer = Renderer(*given, footage=stage.footage)
        self._device, self._footage = device, stage.footage
        self._rested, self._moved = 0, False
        return self._renderer


def _same_kind(now: Frame, then: Frame) -> bool:
    """Whether a renderer of one frame can load the other."""
    size = (now.width, now.height) == (then.width, then.height)
    return size and (now.pose is None) == (then.pose is None)
