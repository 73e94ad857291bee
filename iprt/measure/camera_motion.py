"""Frame sequences for timing: a turning view, or a playing video."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from operator import methodcaller
from typing import TYPE_CHECKING, Protocol

from iprt.geometry.camera import View
from iprt.settings.model import Settings

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.geometry.mesh import Instance
    from iprt.renderer import Renderer
    from iprt.scene.scene import Scene
    from iprt.scene.scene_view import SceneView

TURN_DEG = 0.2
"""Yaw in degrees per frame: 12 degrees per second at 60 frames per second, a slow look around."""
SWING = 25
"""Frames from the middle of the swing to its end. Small enough to keep the objects in view."""

Step = Callable[["Renderer"], None]
"""Function that advances a renderer to its next frame, without rendering it."""


class Reel(Protocol):
    """A reproducible sequence of frames."""

    @property
    def view(self) -> View:
        """View of the first frame."""

    @property
    def settings(self) -> Settings:
        """Settings of the renderer."""

    def renderer(self, device: ComputeDevice) -> Renderer:
        """Return a renderer of the first frame. The caller closes it."""

    def steps(self, device: ComputeDevice, count: int) -> AbstractContextManager[Iterator[Step]]:
        """Return `count` steps. The first one leads to the first frame again."""


@dataclass(frozen=True)
class Turn:
    """A still frame whose view turns back and forth by `TURN_DEG` per frame."""

    frame: Frame
    instances: Sequence[Instance]
    view: View
    settings: Settings

    def renderer(self, device: ComputeDevice) -> Renderer:
        """Return a renderer of the first frame."""
        from iprt.renderer import Renderer

        return Renderer(device, self.frame, self.instances, self.view, self.settings)

    @contextmanager
    def steps(self, device: ComputeDevice, count: int) -> Iterator[Iterator[Step]]:
        """Yield `count` steps, each of which turns the view."""
        del device
        yield (methodcaller("look", turned(self.view, index)) for index in range(count))


@dataclass(frozen=True)
class Playback:
    """A video with its moving camera and objects, played back and forth if it is too short."""

    scene: Scene
    scene_view: SceneView | View
    objects: tuple[str, ...] | None
    settings: Settings

    @property
    def view(self) -> View:
        """View of the first frame."""
        return self._view_at(self.scene.frame_indices[0])

    def _view_at(self, index: int) -> View:
        from iprt.film import view_at

        return view_at(self.scene, self.scene_view, index)

    def _instances_at(self, index: int) -> tuple[Instance, ...]:
        return self.scene.instances_at(self.scene.time_of(index), self.objects)

    def renderer(self, device: ComputeDevice) -> Renderer:
        """Return a renderer of the first frame.

        Raises
        ------
        DeviceError
            The picture needs more memory than the device has.
        """
        from iprt.film import footage_of
        from iprt.memory import require_memory
        from iprt.renderer import Renderer

        first = self.scene.frame_indices[0]
        frame = self.scene.frame(first)
        given = (device, frame, self._instances_at(first), self.view, self.settings)
        footage = footage_of(self.scene, frame, self.settings)
        require_memory(*given, footage)
        return Renderer(*given, footage=footage)

    @contextmanager
    def steps(self, device: ComputeDevice, count: int) -> Iterator[Iterator[Step]]:
        """Yield `count` steps. Waiting for a video frame is host work of the pass `read video`."""
        indices = to_and_fro(self.scene.frame_indices, count)

        def play() -> Iterator[Step]:
            frames = iter(stream)
            for index in indices:
                with device.profile.host("read video"):
                    frame = next(frames)
                yield partial(self._show, index, frame)

        with self.scene.stream(indices, drift=self.settings.drift) as stream:
            yield play()

    def _show(self, index: int, frame: Frame, renderer: Renderer) -> None:
        renderer.load(frame)
        renderer.move(self._instances_at(index))
        renderer.look(self._view_at(index))


def turned(view: View, index: int) -> View:
    """Return the view of frame `index`: it swings about `view` by `TURN_DEG` per frame."""
    if view.projection == "equirect":
        return view
    phase = (index + SWING) % (4 * SWING)
    steps = min(phase, 4 * SWING - phase) - SWING
    return replace(view, yaw_deg=view.yaw_deg + TURN_DEG * steps)


def to_and_fro(indices: range, count: int) -> list[int]:
    """Return `count` frame indices that run through `indices` forwards and backwards."""
    there = [*indices, *indices[-2:0:-1]]
    return [there[number % len(there)] for number in range(count)]
