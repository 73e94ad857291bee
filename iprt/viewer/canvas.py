"""A picture in the making: a renderer that goes where it can, and says where it cannot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from iprt.convergence import Convergence
from iprt.device.compute import ComputeDevice
from iprt.errors import SceneError
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance, require_same_objects, same_places
from iprt.memory import require_memory
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.objects import SceneObject
from iprt.settings.model import Settings
from iprt.viewer.geometry import Geometry
from iprt.viewer.heap import give_back
from iprt.world.shared import Worlds


@dataclass(frozen=True, eq=False)
class Stage:
    """All that there is to see; another one as soon as anything of it changes.

    Attributes
    ----------
    number : int
        Number of the newest change to the world that it shows.
    frame : Frame
    objects : tuple of SceneObject
    instances : tuple of Instance
        The objects, where they are in that frame.
    footage : Footage
    settings : Settings
    exposure : float
        The scene's.
    """

    number: int
    frame: Frame
    objects: tuple[SceneObject, ...]
    instances: tuple[Instance, ...]
    footage: Footage
    settings: Settings
    exposure: float


@dataclass(frozen=True, eq=False)
class Wanted:
    """Description of a picture to render.

    Attributes
    ----------
    stage : Stage
    instances : tuple of Instance
        Those of the stage that are shown.
    view : View
    settings : Settings
    """

    stage: Stage
    instances: tuple[Instance, ...]
    view: View
    settings: Settings


class Canvas:
    """A renderer with what it has accumulated.

    Attributes
    ----------
    rested : int
        View frames since something moved: what the picture is a mean of.
    noise : float or None
        See `Convergence`.

    Parameters
    ----------
    device : ComputeDevice
    wanted : Wanted
    worlds : Worlds
        Those that the device's other pictures use.
    expect : callable
        Called with how often the driver will have to compile, before it does.

    Raises
    ------
    IprtError
        There is too little memory, or what is wanted cannot be rendered.
    """

    def __init__(
        self,
        device: ComputeDevice,
        wanted: Wanted,
        worlds: Worlds,
        expect: Callable[[int], object],
    ) -> None:
        stage = wanted.stage
        given = (device, stage.frame, wanted.instances, wanted.view, wanted.settings)
        self._kernels = require_memory(*given, stage.footage).kernels
        expect(device.to_compile(self._kernels))
        self._renderer = Renderer(*given, footage=stage.footage, worlds=worlds)
        self._version = self._renderer.real_world.version
        self._device, self._footage = device, stage.footage
        self._geometry: Geometry | None = None
        self._outdated = True  # the geometry
        self._convergence = Convergence(wanted.stage.exposure)
        self._moved = False
        self.rested = 0
        self.noise: float | None = None

    def close(self) -> None:
        """Release the device's buffers; it cannot be used any more."""
        self._renderer.close()
        del self._renderer
        give_back()

    def serves(self, device: ComputeDevice, wanted: Wanted) -> bool:
        """Whether it can show that: what it cannot follow needs other kernels or buffers."""
        now, then = wanted.view, self._renderer.view
        if (now.width, now.height, now.projection) != (then.width, then.height, then.projection):
            return False
        if device is not self._device or wanted.settings != self._renderer.settings:
            return False
        frame = wanted.stage.frame
        if wanted.stage.footage != self._footage or not _same_kind(frame, self._renderer.frame):
            return False
        try:
            require_same_objects(self._renderer.instances, wanted.instances)
        except SceneError:
            return False
        return True

    def follow(self, wanted: Wanted) -> None:
        """Go to what is wanted, which it serves."""
        renderer, changed = self._renderer, False
        renderer.load(wanted.stage.frame)
        if renderer.real_world.version != self._version:
            self._version = renderer.real_world.version
            changed, self._geometry = True, None
        if not same_places(renderer.instances, wanted.instances):
            renderer.move(wanted.instances)
            changed = True
        if wanted.view != renderer.view:
            renderer.look(wanted.view)
            changed, self._geometry = True, None
        if changed:
            self.rested, self._moved, self._outdated = 0, True, True

    def paint(self, steps: int, aovs: Sequence[str]) -> RenderedFrame:
        """The picture after so many more view frames, 0 or 1."""
        renderer = self._renderer
        # A fresh renderer that nothing disturbs averages all frames. What was accumulated in
        # motion is blurred by it, and must go: until the frames at rest weigh as much, as in
        # motion, and then by their plain mean, so that nothing jumps.
        at_rest = 1.0 / (self.rested + 1) if self._moved else 0.0
        renderer.fading = min(renderer.settings.fading, at_rest)
        picture = renderer.render(steps, aovs)
        self._device.compile(self._kernels, later=True)
        self._kernels = ()
        self.rested += steps
        self.noise = self._convergence.add(self.rested, picture.color)
        return picture

    def geometry(self, frames: int) -> Geometry | None:
        """The surfaces that the picture shows.

        Reading them takes longer than a quick device needs for a frame. So they come with the
        second frame at rest, or with the last one if `frames` are fewer; until then there are none
        after the camera moved, and those of before after an object did: it slides over what is
        real, which has stayed.
        """
        if self._outdated and self.rested >= min(frames, 2):
            self._geometry = Geometry.of(self._renderer, self._renderer.instances)
            self._outdated = False
        return self._geometry


def _same_kind(now: Frame, then: Frame) -> bool:
    """Whether a renderer of one frame can load the other."""
    size = (now.width, now.height) == (then.width, then.height)
    return size and (now.pose is None) == (then.pose is None)
