"""A renderer that follows changes and accumulates a picture, or reports that it cannot follow."""

from __future__ import annotations

import gc
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
from iprt.viewer.visible_surfaces import Geometry
from iprt.world.shared import Worlds


@dataclass(frozen=True, eq=False)
class Stage:
    """The complete state of the world to render; any change makes a new stage.

    Attributes
    ----------
    number : int
        Number of the newest change to the world that it includes.
    frame : Frame
    objects : tuple of SceneObject
    instances : tuple of Instance
        The objects, placed at the time of the frame.
    footage : Footage
    settings : Settings
    exposure : float
        The scene's exposure.
    time_s : float
        Time of the frame (`Scene.time_of`).
    """

    number: int
    frame: Frame
    objects: tuple[SceneObject, ...]
    instances: tuple[Instance, ...]
    footage: Footage
    settings: Settings
    exposure: float
    time_s: float


class AccumulatingRenderer:
    """A renderer of a stage in a view, with its accumulated picture.

    Attributes
    ----------
    rested : int
        Number of view frames since the last motion, which the picture averages.
    noise : float or None
        See `Convergence`.

    Parameters
    ----------
    device : ComputeDevice
    stage : Stage
    view : View
    worlds : Worlds
        Worlds shared with the device's other pictures.
    expect : callable
        Called before compilation with the expected number of compilations.
    make_room : callable
        Called with the bytes of its buffers, and of the worlds, before they are created.

    Raises
    ------
    IprtError
        There is too little memory, or the picture cannot be rendered.
    """

    def __init__(
        self,
        device: ComputeDevice,
        stage: Stage,
        view: View,
        worlds: Worlds,
        expect: Callable[[int], object],
        make_room: Callable[[int], object],
    ) -> None:
        given = (device, stage.frame, stage.instances, view, stage.settings)
        plan = require_memory(*given, stage.footage)
        make_room(plan.bytes)
        self._kernels = plan.kernels
        expect(device.to_compile(self._kernels))
        self._renderer = Renderer(*given, footage=stage.footage, worlds=worlds)
        self._version = self._renderer.real_world.version
        self._device, self._footage = device, stage.footage
        self._geometry: Geometry | None = None
        self._outdated = True  # refers to the geometry
        self._convergence = Convergence(stage.exposure)
        self._moved = False
        self.rested = 0
        self.noise: float | None = None

    def close(self) -> None:
        """Release the device's buffers; it is unusable afterwards."""
        self._renderer.close()
        del self._renderer
        gc.collect()

    def serves(self, device: ComputeDevice, stage: Stage, view: View) -> bool:
        """Return True if it can show a stage in a view without other kernels or buffers."""
        now, then = view, self._renderer.view
        if (now.width, now.height, now.projection) != (then.width, then.height, then.projection):
            return False
        if device is not self._device or stage.settings != self._renderer.settings:
            return False
        if stage.footage != self._footage or not _same_kind(stage.frame, self._renderer.frame):
            return False
        try:
            require_same_objects(self._renderer.instances, stage.instances)
        except SceneError:
            return False
        return True

    @property
    def pixels(self) -> int:
        """Number of pixels of the picture."""
        return self._renderer.view.width * self._renderer.view.height

    def follow(self, stage: Stage, view: View) -> None:
        """Update the renderer to a stage and a view, for which `serves` must hold."""
        renderer, changed = self._renderer, False
        renderer.load(stage.frame)
        if renderer.real_world.version != self._version:
            self._version = renderer.real_world.version
            changed, self._geometry = True, None
        if not same_places(renderer.instances, stage.instances):
            renderer.move(stage.instances)
            changed = True
        if view != renderer.view:
            renderer.look(view)
            changed, self._geometry = True, None
        if changed:
            self.rested, self._moved, self._outdated = 0, True, True

    def paint(self, steps: int, aovs: Sequence[str]) -> RenderedFrame:
        """Render 0 or 1 more view frames, and return the picture."""
        renderer = self._renderer
        # An undisturbed renderer averages all frames. Frames accumulated in motion are blurred and
        # must fade out. Their weight decays as in motion until the frames at rest weigh the same,
        # and then by the plain mean, so that the picture does not jump.
        at_rest = 1.0 / (self.rested + 1) if self._moved else 0.0
        renderer.fading = min(renderer.settings.fading, at_rest)
        picture = renderer.render(steps, aovs)
        self._device.compile(self._kernels, later=True)
        self._kernels = ()
        self.rested += steps
        self.noise = self._convergence.add(self.rested, picture.color)
        return picture

    def geometry(self, frames: int) -> Geometry | None:
        """Return the surfaces that the picture shows, or None if they are not known yet.

        Reading them back takes longer than a frame on a fast device. They are therefore read with
        the second frame at rest, or with the last one if `frames` are fewer. Until then there are
        none after a motion of the camera. After a motion of an object, the old ones remain valid
        for real surfaces, along which the object is dragged.
        """
        if self._outdated and self.rested >= min(frames, 2):
            self._geometry = Geometry.of(self._renderer, self._renderer.instances)
            self._outdated = False
        return self._geometry


def _same_kind(now: Frame, then: Frame) -> bool:
    """Return True if a renderer of one frame can load the other."""
    size = (now.width, now.height) == (then.width, then.height)
    return size and (now.pose is None) == (then.pose is None)
