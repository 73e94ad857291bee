"""The engine of a viewer: a thread that owns the device, and handles for other threads."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Self

from iprt.device.compute import ComputeDevice
from iprt.device.host_memory import return_freed_memory
from iprt.footage.sun import Sun
from iprt.footage.video.video_table import VideoTable
from iprt.geometry.keyframes import ObjectKeyframe, ViewKeyframe
from iprt.measure.tradeoff import Tradeoff, shipped
from iprt.scene.edit_writing import Look
from iprt.scene.light_edits import LightEdit
from iprt.scene.scene import Scene
from iprt.scene.scene_view import SceneView
from iprt.scene.view_edits import ViewEdit, edited_views
from iprt.settings.model import Settings
from iprt.viewer.autosaver import Autosaver
from iprt.viewer.client import Client
from iprt.viewer.core import Core
from iprt.viewer.object_states import ObjectState
from iprt.viewer.plain_video import PlainFrame
from iprt.viewer.render_queue import RenderQueue
from iprt.viewer.scene_editor import SceneEditor
from iprt.viewer.scene_snapshot import EditedScene
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import Playback, PlaybackMode, Request, Status, World
from iprt.viewer.view_editor import ViewEditor

LEAVING_S = 5.0
"""Longest wait for a thread to end; kernels, compilers and decoders cannot be interrupted."""


class Engine:
    """The engine that renders a scene for any number of clients, newest input first.

    All clients share edits, playback and settings. All methods are thread-safe, and none waits for
    the device.

    Parameters
    ----------
    scene : Scene
    device : callable
        Creates the device on the engine's thread; called again after the driver lost it.
    settings : Settings
    clock : callable
        Returns seconds; the clock of the video.
    allow_outside : bool
        See `Scene.open`.
    tradeoff : Tradeoff or None
        Measured times of the settings for motion; None for the shipped table.
    render_device : str or None
        Device of `renders`, as `choose_device` takes it.

    Attributes
    ----------
    editor : SceneEditor
        Edits of the objects.
    view_editor : ViewEditor
        Edits of the views.
    autosaver : Autosaver
        Keeps unsaved edits, and offers edits that earlier viewers left.
    renders : RenderQueue
        Pictures and videos that are rendered to files.
    """

    def __init__(
        self,
        scene: Scene,
        device: Callable[[], ComputeDevice],
        settings: Settings | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        allow_outside: bool = False,
        tradeoff: Tradeoff | None = None,
        render_device: str | None = None,
    ) -> None:
        return_freed_memory()
        self.renders = RenderQueue(render_device)
        self.tradeoff = tradeoff or shipped()
        self._clock, self._scene = clock, scene
        playback = Playback(scene.frame_indices[0], loop=scene.manifest.video.loop)
        self._shared = SharedState(World(settings or Settings(), playback), clock)
        self._core = Core(self._shared, scene, device, clock=clock, allow_outside=allow_outside)
        self.editor = SceneEditor(self._shared, self._core)
        self.view_editor = ViewEditor(self._shared, lambda: self.views)
        self._views: tuple[Scene, tuple[ViewEdit, ...], dict[str, SceneView]] | None = None
        core = self._core
        self.autosaver = Autosaver(self._shared, core.files, core.jobs, core.note_problem)
        self._thread = threading.Thread(target=self._run, name="iprt viewer", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Cancel all renders, keep unsaved edits for the next start, and end the thread.

        The thread is abandoned after `LEAVING_S`.
        """
        until_s = time.monotonic() + LEAVING_S
        self.renders.close()
        self._shared.close()
        self.autosaver.close()
        self._thread.join(LEAVING_S)
        self._core.jobs.close(until_s)

    def _run(self) -> None:
        core, shared = self._core, self._shared
        try:
            while not shared.closed:
                try:
                    busy = core.turn()
                except Exception as error:
                    # A defect must not lose the user's unsaved edits.
                    core.report_defect(error)
                    busy = False
                if not busy:
                    shared.rest(core.idle_s)
        finally:
            core.close()

    # Clients and state ------------------------------------------------------------------------

    def client(self, request: Request) -> Client:
        """Connect a client."""
        return Client(self._shared, self._core, request)

    @property
    def world(self) -> World:
        """The state that all clients share, as requested."""
        return self._shared.world

    @property
    def playback(self) -> Playback:
        """The playback of the video, which all clients share."""
        return self._shared.world.playback

    @property
    def scene(self) -> Scene:
        """The scene as last read."""
        return self._core.scene or self._scene

    @property
    def objects(self) -> tuple[ObjectState, ...]:
        """The objects with all edits, placed at the time of the next frame.

        It is empty before the first frame.
        """
        return self._core.objects

    def object_state(self, name: str | None) -> ObjectState | None:
        """Return an object with all edits, including unrendered ones; None if it is missing."""
        state = next((state for state in self.objects if state.name == name), None)
        return None if state is None else state.edited(self.world.edit_of(state.name))

    @property
    def ready(self) -> bool:
        """True if the requested frame is known, and `objects` has all edits."""
        return self._core.ready

    @property
    def problem(self) -> str | None:
        """The reason why the first frame does not come; None if there is none."""
        return self._core.problem_of()

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._shared.closed

    @property
    def loading(self) -> bool:
        """True while files are read, or light and reflections are looked for."""
        return bool(self._core.jobs.running)

    @property
    def views(self) -> Mapping[str, SceneView]:
        """The views with all edits, by name."""
        origin, edits, known = self._origin, self.world.views, self._views
        if known is None or known[0] is not origin or known[1] != edits:
            objects = tuple(table.name for table in origin.manifest.objects)
            self._views = known = origin, edits, edited_views(origin.views, edits, objects)
        return known[2]

    @property
    def plain_frame(self) -> PlainFrame | None:
        """The color of the newest video frame, or None before the first is read."""
        return self._core.plain.frame

    @property
    def status(self) -> Status:
        """The engine's current activity and problems."""
        return self._shared.status

    # The video --------------------------------------------------------------------------------

    def play(self) -> int:
        """Play the video, from the start if it is at its end."""
        frames = self.scene.frame_indices

        def change(playback: Playback) -> Playback:
            at_end = playback.frame >= frames[-1] and not playback.loop
            frame = frames[0] if at_end else playback.frame
            return playback if playback.playing else self._from(playback, frame, playing=True)

        return self._change_playback(change)

    def pause(self) -> int:
        """Pause at the current frame."""
        return self._change_playback(
            lambda playback: self._from(playback, self._position(playback), playing=False)
        )

    def seek(self, frame: int) -> int:
        """Go to the nearest existing frame; a playing video continues from there."""
        frames = self.scene.frame_indices
        frame = min(max(frame, frames[0]), frames[-1])
        return self._change_playback(
            lambda playback: self._from(playback, frame, playing=playback.playing)
        )

    def set_playback_mode(self, mode: PlaybackMode) -> int:
        """Play in real time, or every frame; a playing video continues where it is."""
        return self._change_playback(lambda playback: replace(self._now(playback), mode=mode))

    def set_loop(self, loop: bool) -> int:
        """Set whether the video restarts at its end."""
        return self._change_playback(lambda playback: replace(self._now(playback), loop=loop))

    def _change_playback(self, change: Callable[[Playback], Playback]) -> int:
        return self._shared.change(lambda world: replace(world, playback=change(world.playback)))

    def _position(self, playback: Playback) -> int:
        """Return the frame that the playback has reached."""
        if playback.mode == "every frame":
            return self._core.video.position(playback)
        scene = self.scene
        due = playback.due(self._clock(), scene.source.fps)
        return playback.index(due, scene.frame_indices)

    def _now(self, playback: Playback) -> Playback:
        """Return the playback restarted at the frame that it has reached."""
        return self._from(playback, self._position(playback), playing=playback.playing)

    def _from(self, playback: Playback, frame: int, *, playing: bool) -> Playback:
        return replace(playback, frame=frame, since_s=self._clock() if playing else None)

    # The scene --------------------------------------------------------------------------------

    def set_settings(self, settings: Settings) -> int:
        """Render with other settings, which may need compilation."""
        return self._shared.change(lambda world: replace(world, settings=settings))

    def animate(
        self,
        objects: Mapping[str, tuple[ObjectKeyframe, ...]],
        views: Mapping[str, tuple[ViewKeyframe, ...]],
    ) -> int:
        """Replace the keyframes of objects and views, by name."""

        def change(world: World) -> World:
            for name, keyframes in objects.items():
                world = world.edited(name, keyframes=keyframes)
            for name, keys in views.items():
                world = world.view_edited(name, keyframes=keys)
            return world

        return self._shared.edit(change)

    # Its light --------------------------------------------------------------------------------

    @property
    def video(self) -> VideoTable:
        """The table `[video]` of scene.toml with the edits of light."""
        return self.world.light.applied(self._own_video)

    @property
    def _own_video(self) -> VideoTable:
        return self._origin.manifest.video

    @property
    def _origin(self) -> Scene:
        """The scene without any edits, saved or not."""
        loaded = self._core.files.loaded
        return self._scene if loaded is None else loaded.origin

    @property
    def sun(self) -> Sun | None:
        """The sun with all edits; until one that is looked for is found, the one before it."""
        lit = self._core.light.lit
        return None if lit is None else lit.daylight(self.video).sun

    @property
    def light_lines(self) -> list[tuple[str, str]]:
        """Labels and sentences about light and reflections, as in `iprt scene info`."""
        return self._core.light.lines(self.video)

    def set_light(self, edit: LightEdit) -> int:
        """Change the given keys of `[video]`."""
        own = self._own_video
        parts = {k: None if v == getattr(own, k) else v for k, v in edit.parts.items()}
        return self._shared.edit(lambda world: replace(world, light=replace(world.light, **parts)))

    def set_edits(self, world: World) -> int:
        """Take all edits from another world, as one step of undo."""
        return self._shared.edit(
            lambda now: replace(now, edits=world.edits, light=world.light, views=world.views),
            alone=True,
        )

    # All edits --------------------------------------------------------------------------------

    def undo(self) -> int:
        """Undo the last edit, or the last whole gesture.

        Edits of all clients are undone in their order, including saved ones.
        """
        return self._shared.undo()

    def redo(self) -> int:
        """Redo the last undone edit, if there was no edit since."""
        return self._shared.redo()

    @property
    def can_undo(self) -> bool:
        """True if there is an edit to undo."""
        return self._shared.history.can_undo

    @property
    def can_redo(self) -> bool:
        """True if there is an edit to redo."""
        return self._shared.history.can_redo

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Names of the objects, and keys of `[video]`, that differ from the scene's file."""
        return self.world.unsaved

    @property
    def edited(self) -> EditedScene | None:
        """The scene with all edits, for a render; None before it is read."""
        return self._core.files.edited()

    def save(
        self, done: Callable[[str | None], object] = lambda _: None, look: Look | None = None
    ) -> None:
        """Write all edits to the scene's file, keeping comments; `status` reports problems.

        Parameters
        ----------
        done : callable
            Called by the engine's thread with the problem, or None after success.
        look : Look or None
            The user's view. It is saved if an added object is not in the scene's other views
            (`save_edits`).
        """
        self._core.files.save(done, look)
