"""Rendering of a video with its objects, frame by frame, with all motion."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Self

from iprt.convergence import Goal
from iprt.device.compute import ComputeDevice
from iprt.device.recovery import end_of, wait
from iprt.errors import DeviceError
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.memory import RenderPlan, require_memory
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.scene import Scene
from iprt.scene.scene_view import SceneView
from iprt.settings.model import Settings

LEAVING_S = 5.0
"""Longest wait for an idle device at the end."""
START_STEPS = 12
"""Most view frames of a warm-up that repeats one frame of the video, where nothing moves."""
MEMORY_DOUBLED = 10
"""Most frames for a long memory, the earliest of them 512 warm-ups back."""


class Film:
    """Renderer of a scene's video, one view frame after another.

    Parameters
    ----------
    view : SceneView or View
        A view of the scene moves as the scene says; a plain one is fixed.
    objects : tuple of str or None
        Names of the objects to insert. None: the scene view's, or all.
    accumulate : int
        View frames per frame of the video; the picture is the last. See `memory`.
    strict : bool
        Stop at the first frame of the video that cannot be read, rather than bridge it.

    Attributes
    ----------
    prepare_ms : float
        Time spent on preparing passes before the first view frame.
    """

    def __init__(
        self,
        scene: Scene,
        device: ComputeDevice,
        settings: Settings,
        *,
        view: SceneView | View,
        objects: tuple[str, ...] | None = None,
        accumulate: int = 1,
        strict: bool = False,
    ) -> None:
        self.scene, self.device, self.settings = scene, device, memory(settings, accumulate)
        self.accumulate, self.strict = accumulate, strict
        self.prepare_ms = 0.0
        self._view = view
        self._objects = view.objects if objects is None and isinstance(view, SceneView) else objects
        self._renderer: Renderer | None = None

    def close(self) -> None:
        """Release the resources of the last run of frames."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if not isinstance(error, DeviceError):
            # A driver whose kernels still run when the program ends may crash.
            with suppress(DeviceError), self.device.reported("its end"):
                wait(self.device.name, end_of(self.device.queue), LEAVING_S)
        self.close()

    def frames(
        self,
        indices: Sequence[int],
        *,
        warm_up: int = 0,
        wanted: Container[int] | None = None,
        aovs: Iterable[str] = (),
        progress: Callable[[int], None] | None = None,
        goal: Goal | None = None,
    ) -> Iterator[tuple[int, RenderedFrame]]:
        """Render frames in the order of `indices`, with nothing accumulated by earlier calls.

        Only one call may be active. At most a few frames are held in memory.

        Parameters
        ----------
        indices : sequence of int
            Numbers of frames of the video.
        warm_up : int
            Frames rendered before the first, to build its history: the preceding ones, in the step
            of `indices`. Before the start of the video, its first frame is repeated for
            `START_STEPS` view frames at most. State with a longer memory (the background that
            moving things hide) is built from a few frames before those, which are not rendered.
        wanted : container of int or None
            Numbers of the frames to yield, some of which may precede `indices`. Rendering ends
            with the last of them. None: `indices`.
        aovs : names from `iprt.aovs.AOVS`
        progress : callable or None
            Called with the number of finished view frames of a frame after each.
        goal : Goal or None
            For one frame: renders as many view frames as the goal needs, in place of `accumulate`.

        Yields
        ------
        (int, RenderedFrame)

        Raises
        ------
        SceneError
            No such frame.
        FormatError
            The files of a frame cannot be used; if not `strict`, of the first.
        DeviceError
            A picture needs more memory than the device has.
        """
        self.close()
        aovs = tuple(aovs)
        first = self.scene.frame_indices[0]
        before = warm_up_indices(indices, warm_up, first)
        remembered = memory_indices(before, first) if self.scene.source.static_camera else []
        # How many times `accumulate` each frame is rendered, and whether it is yielded.
        most = max(START_STEPS // self.accumulate, 1)
        wanted = indices if wanted is None else wanted
        shown = [(index, 0, False) for index in remembered]
        shown += [
            (index, min(times, most), index in wanted and index not in indices)
            for index, times in Counter(before).items()
        ]
        shown += [(index, 1, index in wanted) for index in indices]
        several = len(self.scene.frame_indices) > 1 and len(shown) > 1
        while shown and not shown[-1][-1]:
            shown.pop()
        chosen = [index for index, _, _ in shown]
        drift = self.settings.drift and several
        with self.scene.stream(chosen, strict=self.strict, drift=drift) as frames:
            _ = self.scene.objects  # are read while the first frame is prepared
            for (index, times, yielded), frame in zip(shown, frames, strict=True):
                renderer = self._showing(frame, index, several=several)
                del frame
                if not times:
                    continue
                layers = aovs if yielded else ()
                if goal is None:
                    picture = renderer.render(times * self.accumulate, layers, progress)
                else:
                    picture = converged(renderer, goal, layers, progress)
                self.device.finish()  # reads events: hours of them would fill the memory
                if yielded:
                    yield index, picture
                del picture

    def _showing(self, frame: Frame, index: int, *, several: bool) -> Renderer:
        """Return the renderer with a frame loaded; `several`: more frames may follow."""
        view = self.view_at(index)
        instances = self.scene.instances_at(self.scene.time_of(index), self._objects)
        renderer = self._renderer
        if renderer is not None:
            renderer.load(frame)
            renderer.move(instances)
            renderer.look(view)
            return renderer
        footage = footage_of(self.scene, frame, self.settings) if several else None
        given = (self.device, frame, instances, view, self.settings)
        plan = require_memory(*given, footage)
        self.device.compile(plan.kernels, later=several)
        self._renderer = renderer = Renderer(*given, footage=footage)
        if not self.prepare_ms:
            self.device.finish()
            self.prepare_ms = self.device.profile.prepared()
        return renderer

    def view_at(self, index: int) -> View:
        """Return the view in a frame of the video."""
        return view_at(self.scene, self._view, index)


def converged(
    renderer: Renderer,
    goal: Goal,
    aovs: Iterable[str] = (),
    progress: Callable[[int], None] | None = None,
) -> RenderedFrame:
    """Return the picture of a fresh renderer once it meets the goal."""
    while goal.next_frames > goal.frames:
        done, count = goal.frames, goal.next_frames

        def forward(more: int, done: int = done) -> None:
            if progress is not None:
                progress(done + more)

        goal.add(count, renderer.render(count - done, progress=forward).color)
    return renderer.render(0, aovs)


def memory(settings: Settings, accumulate: int) -> Settings:
    """Return settings for `accumulate` view frames per frame of the video.

    The gain in fading is spent half on less noise of the renderer and half on following the video
    more closely. Over an unchanged number of view frames, the mean would hold less of the video,
    whose noise reflections show. Over an unchanged number of its frames, it would lag as far
    behind.
    """
    return settings.model_copy(update={"fading": settings.fading / accumulate**0.5})


def film_plan(scene: Scene, frame: Frame, instances: Iterable[Instance], view: View) -> RenderPlan:
    """Return the plan of a film of all frames of the scene, of which `frame` is one."""
    settings = Settings()
    footage = footage_of(scene, frame, settings) if len(scene.frame_indices) > 1 else None
    return RenderPlan.of(frame, instances, view, settings, footage)


def footage_of(scene: Scene, frame: Frame, settings: Settings) -> Footage:
    """Return the properties of a scene's video, of which `frame` is a frame."""
    return Footage.of(
        frame,
        clips=scene.clips,
        drifts=settings.drift,
        video=len(scene.frame_indices) > 1,
        static_camera=scene.source.static_camera,
    )


def view_at(scene: Scene, view: SceneView | View, index: int) -> View:
    """Return `view` in a frame of the video, in its own size."""
    if isinstance(view, View):
        return view
    return view.at(scene.time_of(index)).resized(view.view.width, view.view.height)


def warm_up_indices(indices: Sequence[int], count: int, first: int) -> list[int]:
    """Return the `count` frames before `indices`, in their step, with `first` repeated as needed.

    Indices that are not a range, or that run backwards, count as steps of 1.
    """
    step = max(indices.step, 1) if isinstance(indices, range) else 1
    return [max(indices[0] - step * back, first) for back in range(count, 0, -1)]


def memory_indices(before: Sequence[int], first: int) -> list[int]:
    """Return frames before a warm-up's, down to `first`, at ever longer intervals."""
    distances = [len(before) * 2**doubled for doubled in range(MEMORY_DOUBLED)]
    found = {before[0] - distance for distance in distances} if before else set()
    return sorted(index for index in found if index >= first)
