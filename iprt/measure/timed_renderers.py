"""Renderers to compare on the same picture: iprt and Mitsuba, each with its scene in memory."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from iprt.measure.combinations import Combination, still_settings
from iprt.measure.measurement import Measurement
from iprt.measure.view_truth import Radiance, Target, with_frames

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.geometry.mesh import Instance
    from iprt.renderer import Renderer
    from iprt.scene.scene import Scene

OURS = "iprt"
FULL, PANORAMA = "Mitsuba, full geometry", "Mitsuba, panorama"


@dataclass(frozen=True)
class RacedView:
    """A view to render, from which a process can load the scene.

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


@dataclass(frozen=True)
class RacedRenderer:
    """A renderer that can be sent to a process.

    Attributes
    ----------
    label : str
        Name in reports.
    load : callable
        Imports the renderer and loads a view.
    """

    label: str
    load: Callable[[RacedView], TimedRenderer]


def raced_iprt(combination: Combination, device: str | None) -> RacedRenderer:
    """Return iprt with a combination of settings; for `device` see `choose_device`."""
    label = f"{OURS}, {combination.label}" if combination.values else OURS
    return RacedRenderer(label, partial(_load_iprt, combination, device))


def raced_mitsuba(model: str | None) -> RacedRenderer:
    """Return Mitsuba's path tracer, with the full geometry or in the panorama's world.

    Parameters
    ----------
    model : str or None
        Module that builds the full geometry. None: geometry and light of the panorama, over the
        target's background.
    """
    if model is None:
        return RacedRenderer(PANORAMA, _load_panorama)
    return RacedRenderer(FULL, partial(_load_full, model))


def _load_iprt(combination: Combination, spec: str | None, view: RacedView) -> TimedRenderer:
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice

    device = ComputeDevice(choose_device(spec))
    return TimedIprt(combination, device, view.frame(), view.instances(), view.target)


def _load_full(model: str, raced: RacedView) -> TimedRenderer:
    from iprt.truth.model import load_parts, load_scene, render_color
    from iprt.truth.shapes import instance_shapes

    view = raced.target.view
    scene = load_scene({**load_parts(model), **instance_shapes(raced.instances())})
    return TimedMitsuba(lambda spp, seed: render_color(scene, view, spp=spp, seed=seed))


def _load_panorama(raced: RacedView) -> TimedRenderer:
    from iprt.truth.panorama import load_world, render_reference

    target = raced.target
    world = load_world(raced.frame(), raced.instances())

    def render(spp: int, seed: int) -> Radiance:
        result = render_reference(world, target.view, spp=spp, seed=seed)
        if target.background is None:
            return result.color
        uncovered = 1.0 - result.coverage[..., None]
        return uncovered * target.background * result.ratio + result.objects

    return TimedMitsuba(render)


class TimedMitsuba:
    """Mitsuba in this process; `render` returns a picture of samples per pixel and a seed."""

    def __init__(self, render: Callable[[int, int], Radiance]) -> None:
        self._render = render

    def prepare(self, seed: int) -> None:
        """Render one picture."""
        self._render(1, seed)

    def picture(self, count: int, seed: int) -> tuple[float, Radiance]:
        """Render `count` samples per pixel; return seconds and linear radiance."""
        start = time.perf_counter()
        color = self._render(count, seed)
        return time.perf_counter() - start, color


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
        self.frame, self.instances = frame, instances
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
        require_memory(self._device, self.frame, self.instances, self._target.view, settings)
        renderer = self._renderer = self._new()
        renderer.render(1)
        # `_worlds` holds weak references only.
        self._kept = renderer.world if self.instances else renderer.real_world
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
            self.frame,
            self.instances,
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


def timed_iprt(plan: Measurement) -> Iterator[tuple[Target, Combination, TimedIprt]]:
    """Yield a renderer for each view and combination of settings."""
    for target, frame in with_frames(plan.scene, plan.targets):
        instances = plan.scene.instances_named(target.objects)
        for combination in plan.chosen:
            yield target, combination, TimedIprt(combination, plan.device, frame, instances, target)
