"""Renderers to compare on the same picture: iprt and Mitsuba, each with its scene in memory."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from iprt.measure.sweep import Combination, still_settings
from iprt.measure.view_truth import Radiance, Target

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.geometry.mesh import Instance
    from iprt.renderer import Renderer
    from iprt.scene.scene import Scene

OURS = "iprt"
FULL, PANORAMA = "Mitsuba, full geometry", "Mitsuba, panorama"


@dataclass(frozen=True)
class Subject:
    """A view to render.

    Attributes
    ----------
    root : Path
        Scene folder.
    allow_outside : bool
        See `Scene.open`.
    target : Target
    """

    root: Path
    allow_outside: bool
    target: Target

    @cached_property
    def _scene(self) -> Scene:
        from iprt.scene.scene import Scene

        return Scene.open(self.root, allow_outside=self.allow_outside)

    def frame(self) -> Frame:
        """Read the video frame."""
        return self._scene.frame(self.target.index)

    def instances(self) -> tuple[Instance, ...]:
        """Read the objects."""
        return self._scene.instances_named(self.target.objects)


class TimedRenderer(Protocol):
    """A renderer with a scene in memory."""

    def prepare(self, seed: int) -> None:
        """Render one picture to do all work that is shared by the pictures of this seed."""

    def picture(self, count: int, seed: int) -> tuple[float, Radiance]:
        """Render `count` frames or samples per pixel; return seconds and linear radiance.

        The time runs from the state after `prepare` to the picture in host memory. Samples of
        other pictures are not reused.
        """


class Entry(Protocol):
    """A picklable description of a renderer, from which a process can build it."""

    @property
    def label(self) -> str:
        """Name of the renderer in reports."""

    def renderer(self, subject: Subject) -> TimedRenderer:
        """Import, load and build the renderer."""


@dataclass(frozen=True)
class IprtEntry:
    """iprt with a combination of settings; for `device` see `choose_device`."""

    combination: Combination
    device: str | None

    @property
    def label(self) -> str:
        """`iprt`, with the swept values if there are any."""
        changed = self.combination.values
        return f"{OURS}, {self.combination.label}" if changed else OURS

    def renderer(self, subject: Subject) -> TimedRenderer:
        """Open the device and load the scene."""
        from iprt.device.choose import choose_device
        from iprt.device.compute import ComputeDevice

        device = ComputeDevice(choose_device(self.device))
        frame, instances = subject.frame(), subject.instances()
        return TimedIprt(self.combination, device, frame, instances, subject.target)


@dataclass(frozen=True)
class FullEntry:
    """Mitsuba's path tracer with the full geometry, built by the Python module `model`."""

    model: str
    label: str = field(default=FULL, init=False)

    def renderer(self, subject: Subject) -> TimedRenderer:
        """Load the full geometry and the objects."""
        return _Full(self.model, subject)


@dataclass(frozen=True)
class PanoramaEntry:
    """Mitsuba with the geometry and light of the panorama, over the target's background."""

    label: str = field(default=PANORAMA, init=False)

    def renderer(self, subject: Subject) -> TimedRenderer:
        """Load the panorama and the objects."""
        return _Panorama(subject)


class TimedIprt:
    """iprt in this process.

    A picture continues the last one if that has fewer frames and the same seed.
    """

    def __init__(
        self,
        combination: Combination,
        device: ComputeDevice,
        frame: Frame,
        instances: Sequence[Instance],
        target: Target,
    ) -> None:
        from iprt.world.shared import Worlds

        self._combination, self._device, self._target = combination, device, target
        self._frame, self._instances = frame, instances
        self._worlds = Worlds()
        self._kept: Any = None
        self._renderer: Renderer | None = None
        self._seed, self._done, self._seconds = -1, 0, 0.0

    def prepare(self, seed: int) -> None:
        """Render one picture, and keep its world for the pictures of this seed."""
        from iprt.memory import require_memory

        self._drop()
        self._seed = seed
        settings = still_settings(self._combination.settings, seed)
        require_memory(self._device, self._frame, self._instances, self._target.view, settings)
        renderer = self._renderer = self._new()
        renderer.render(1)
        # `_worlds` holds weak references only.
        self._kept = renderer.world if self._instances else renderer.real_world
        self._drop()

    def picture(self, count: int, seed: int) -> tuple[float, Radiance]:
        """Render `count` frames; return seconds and linear radiance."""
        if seed != self._seed:
            self.prepare(seed)
        if count <= self._done:
            self._drop()
        start = time.perf_counter()
        if self._renderer is None:
            self._renderer = self._new()
        color = self._renderer.render(count - self._done).color
        self._seconds += time.perf_counter() - start
        self._done = count
        self._device.profile.reset()  # else it would keep the events of all frames
        return self._seconds, color

    def _new(self) -> Renderer:
        from iprt.renderer import Renderer

        renderer = Renderer(
            self._device,
            self._frame,
            self._instances,
            self._target.view,
            still_settings(self._combination.settings, self._seed),
            background=self._target.background,
            worlds=self._worlds,
        )
        if renderer.real_world.irradiance is not None:
            renderer.real_world.irradiance.forget()
        return renderer

    def _drop(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
        # Released before the next renderer is made, which can then reuse the mapped memory.
        self._renderer, self._done, self._seconds = None, 0, 0.0


class _Full:
    """Mitsuba's path tracer for the whole picture, including the background."""

    def __init__(self, model: str, subject: Subject) -> None:
        from iprt.truth.model import load_parts, load_scene
        from iprt.truth.shapes import instance_shapes

        self._view = subject.target.view
        self._scene = load_scene({**load_parts(model), **instance_shapes(subject.instances())})

    def prepare(self, seed: int) -> None:
        """Render one picture."""
        self.picture(1, seed)

    def picture(self, count: int, seed: int) -> tuple[float, Radiance]:
        """Render `count` samples per pixel; return seconds and linear radiance."""
        from iprt.truth.model import render_color

        start = time.perf_counter()
        color = render_color(self._scene, self._view, spp=count, seed=seed)
        return time.perf_counter() - start, color


class _Panorama:
    """Differential rendering with Mitsuba: objects over the relit background of the target."""

    def __init__(self, subject: Subject) -> None:
        from iprt.truth.panorama import load_world

        self._target = subject.target
        self._world = load_world(subject.frame(), subject.instances())

    def prepare(self, seed: int) -> None:
        """Render one picture."""
        self.picture(1, seed)

    def picture(self, count: int, seed: int) -> tuple[float, Radiance]:
        """Render `count` samples per pixel; return seconds and linear radiance."""
        from iprt.truth.panorama import render_reference

        start = time.perf_counter()
        result = render_reference(self._world, self._target.view, spp=count, seed=seed)
        color = result.color
        if self._target.background is not None:
            uncovered = 1.0 - result.coverage[..., None]
            color = uncovered * self._target.background * result.ratio + result.objects
        return time.perf_counter() - start, color
