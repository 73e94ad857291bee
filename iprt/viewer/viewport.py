"""A window on the scene: camera, lens and displayed picture."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.geometry.pose import view_from
from iprt.scene.edit_writing import Look
from iprt.scene.placement import set_on
from iprt.scene.scene_view import SceneView
from iprt.viewer.client import Client
from iprt.viewer.controls import with_value
from iprt.viewer.displayed_frame import DisplayedFrame, PictureDeveloper
from iprt.viewer.engine import Engine
from iprt.viewer.frame_rate import FrameRate
from iprt.viewer.lens import Lens
from iprt.viewer.motion_quality import MotionQuality
from iprt.viewer.object_states import ObjectState
from iprt.viewer.picking import Picking, Readout
from iprt.viewer.screenshots import free_path, metadata_of, write_screenshot
from iprt.viewer.session import Shown
from iprt.viewer.snapshot import Snapshot
from iprt.viewer.state import REST_FRAMES, Request
from iprt.viewer.surroundings import Surroundings, SurroundingsDeveloper
from iprt.viewer.truth_reader import truth_problem

MIN_FOV_DEG, MAX_FOV_DEG = 2.0, 150.0
ZOOM_STEP = 0.9
"""Factor on the field of view per step of the wheel."""


class Viewport:
    """The camera and lens of a window, for use by one thread at a time.

    Positions in the picture are fractions of its width and height, from the upper left corner.

    Parameters
    ----------
    engine : Engine
    view : View
        Initial view; its size is the window's, in pixels.
    objects : tuple of str or None
        Names of the shown objects; None for all.
    target_fps : float or None
        Frames per second to hold during motion, at reduced quality; None keeps it full.
    frames : int
        View frames to which a picture at rest is refined.
    clock : callable
        Returns seconds.

    Attributes
    ----------
    view : View
        Current view, with the window's size.
    name : str or None
        Name of the scene's view, until the user turns away. Until then its keyframes turn the view.
    last_name : str or None
        Name of the scene's view that was shown last.
    motion : MotionQuality
        Quality during motion.
    picking : Picking
        Objects and surfaces in the displayed picture.
    snapshot : Snapshot or None
        The last one taken.
    pins : list of (x, y)
        Positions in the picture whose values are shown.
    """

    def __init__(
        self,
        engine: Engine,
        view: View,
        *,
        objects: tuple[str, ...] | None = None,
        target_fps: float | None = None,
        frames: int = REST_FRAMES,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._engine, self._time = engine, clock
        self.view, self.name = _fitted(view, view.width, view.height), self._name_of(view, objects)
        self.last_name, self._objects, self._frames = self.name, objects, frames
        self._lens, self.motion = Lens(), MotionQuality(target_fps, engine.tradeoff, clock)
        self._edits = engine.world.edits, engine.world.light, engine.world.views
        self._developer, self._surroundings = PictureDeveloper(), SurroundingsDeveloper(engine)
        self._displayed: DisplayedFrame | None = None
        self._made_of: tuple[object, ...] = ()
        self._latency_s: float | None = None
        self._asked: deque[tuple[int, float]] = deque(maxlen=256)  # number and time of inputs
        self.picking, self._frame_rate = Picking(), FrameRate(clock)
        self.snapshot: Snapshot | None = None
        self.pins: list[tuple[float, float]] = []
        self._show_added()
        self._wanted = self._request()
        self._client = engine.client(self._wanted)
        self._baseline: Client | None = None

    def close(self) -> None:
        """Disconnect from the engine."""
        self._client.close()
        if self._baseline is not None:
            self._baseline.close()
        self._developer.close()

    # Where it looks ---------------------------------------------------------------------------

    def turn(self, dx_px: float, dy_px: float) -> None:
        """Drag the picture by pixels of the window, right and down."""
        view = self.view
        if view.projection == "equirect":
            return
        degrees = float(np.rad2deg(1.0 / view.focal_px))
        yaw = (view.yaw_deg - dx_px * degrees + 180.0) % 360.0 - 180.0
        pitch = min(max(view.pitch_deg + dy_px * degrees, -90.0), 90.0)
        self.look(replace(view, yaw_deg=yaw, pitch_deg=pitch))

    def zoom(self, steps: float) -> None:
        """Narrow the field of view by steps of the wheel, or widen it by negative ones."""
        if self.view.projection == "equirect":
            return
        wanted = self.view.fov_y_deg * ZOOM_STEP**steps
        self.look(replace(self.view, fov_y_deg=min(max(wanted, MIN_FOV_DEG), MAX_FOV_DEG)))

    def look(self, view: View) -> None:
        """Change the view, at the window's size."""
        view = view.resized(self.view.width, self.view.height)
        if view != self.view:
            self.view, self.name = view, None
            self.motion.stir()
            self._input()

    def resize(self, width: int, height: int) -> None:
        """Resize to the window's size, in pixels; 0 counts as 1."""
        if (view := _fitted(self.view, max(width, 1), max(height, 1))) != self.view:
            self.view = view
            self.motion.stir()
            self._input()

    def go_to(self, name: str) -> None:
        """Switch to a view of the scene and its objects, at the displayed video frame."""
        self.name = self.last_name = name
        self._turn_as_the_video_plays()
        self._objects = self._engine.views[name].objects
        self._show_added()
        self._input()

    def _turn_as_the_video_plays(self) -> None:
        """Turn to where the scene's view looks at the frame, unless the user turned away."""
        if self._entry is not None:
            now = self._entry.at(self._engine.scene.time_of(self.frame))
            self.view = now.resized(self.view.width, self.view.height)

    @property
    def _entry(self) -> SceneView | None:
        return None if self.name is None else self._engine.views.get(self.name)

    @property
    def frame(self) -> int:
        """The requested video frame, or the displayed one during playback."""
        playback, shown = self._engine.playback, self._client.shown
        return playback.frame if not playback.playing or shown is None else shown.frame

    def _name_of(self, view: View, objects: tuple[str, ...] | None) -> str | None:
        """Return the scene's view with this direction, preferably with the same objects."""
        views = self._engine.views.values()
        found = [entry for entry in views if entry.view.resized(view.width, view.height) == view]
        return min(found, key=lambda entry: entry.objects != objects).name if found else None

    def take_snapshot(self) -> bool:
        """Keep the picture for comparisons; return False if there is none yet."""
        shown = self._client.shown
        if shown is None or shown.plain:
            return False
        self.snapshot = Snapshot(shown.picture, shown.request, shown.frame, self._engine.world)
        return True

    # How it is shown --------------------------------------------------------------------------

    @property
    def lens(self) -> Lens:
        """Display settings of the window."""
        return self._lens

    @lens.setter
    def lens(self, lens: Lens) -> None:
        before, self._lens = self._lens, lens
        if (before.buffer, before.against) != (lens.buffer, lens.against):
            self._input()

    @property
    def objects(self) -> tuple[str, ...] | None:
        """Names of the shown objects, including added ones; None for all."""
        return self._objects

    @objects.setter
    def objects(self, names: tuple[str, ...] | None) -> None:
        if names != self._objects:
            self._objects = names
            self._input()

    def _show_added(self) -> None:
        """Show objects added by any client, even after they are saved."""
        if self._objects is not None:
            added = self._engine.editor.added
            self._objects += tuple(name for name in added if name not in self._objects)

    def _input(self) -> None:
        """Send the current request, and start measuring its latency."""
        self._asked.append((self._ask(), self._time()))

    def _follow(self) -> None:
        """Send a new request after changes by others, and between motion and rest."""
        world = self._engine.world
        if (world.edits, world.light, world.views) != self._edits:
            self._edits = world.edits, world.light, world.views
            self._show_added()
            self.motion.stir()
        if self._request() != self._wanted:
            self._ask()

    def _ask(self) -> int:
        self._wanted = request = self._request()
        number = self._client.ask(request)
        if self._lens.method is not None:
            settings = request.settings or self._engine.world.settings
            baseline = with_value(settings, "method", self._lens.method)
            request = replace(request, settings=baseline, aovs=(), geometry=False)
            if self._baseline is None:
                self._baseline = self._engine.client(request)
            else:
                self._baseline.ask(request)
        elif self._baseline is not None:
            self._baseline.close()
            self._baseline = None
        return number

    def _request(self) -> Request:
        lens, world = self._lens, self._engine.world
        # In "every frame" mode, each frame has full quality.
        playing = world.playback.playing and world.playback.mode == "real time"
        level = self.motion.level(world.settings, playing=playing)
        view = self.view
        if lens.against == "truth" and self.name is not None:
            view = self._developer.truth.view(self._engine.scene, self.name, view)
        elif level is not None:
            sides = (max(round(side * level.scale), 1) for side in (view.width, view.height))
            view = view.resized(*sides)
        aovs = [] if lens.buffer is None else [lens.buffer]
        if lens.against == "input" and "background" not in aovs:
            aovs.append("background")
        settings = None if level is None else level.settings
        motion = None if self._entry is None else self._entry.motion
        return Request(view, self.objects, settings, tuple(aovs), True, self._frames, motion)

    # The picture ------------------------------------------------------------------------------

    def poll(self) -> DisplayedFrame | None:
        """Return the newest picture, the same object if nothing is new; None before the first."""
        shown = self._client.shown
        if shown is not None and (self._displayed is None or shown is not self._displayed.shown):
            self.motion.observe(shown)
            self.picking.follow(shown)
            self._frame_rate.follow(self._engine.playback.since_s, shown.frame)
        self._turn_as_the_video_plays()
        self._follow()
        if shown is None:
            return None
        other = None if self._baseline is None else self._baseline.shown
        (edits, _, views), lively = self._edits, self.motion.lively
        state = self.snapshot, self._lens, self.name, self._developer.scores
        made_of = (shown, other, *state, self._edits, lively)
        if self._displayed is None or made_of != self._made_of:
            self._clock(shown)
            found = self._developer.develop(
                self._engine.scene,
                self.name,
                self._lens,
                shown,
                other,
                self.snapshot,
                edits,
                views,
            )
            self._made_of = made_of
            self._displayed = DisplayedFrame(
                **vars(found),
                shown=shown,
                preview=self.motion.preview(shown),
                latency_s=self._latency_s if lively else None,
                fps=self.motion.fps,
            )
        return self._displayed

    @property
    def surroundings(self) -> Surroundings | None:
        """The video around a turned picture, the same object if nothing is new."""
        return self._surroundings.newest(self._lens)

    @property
    def counter(self) -> str | None:
        """The frame's number and the last one's, with the rate; None for a single frame."""
        scene = self._engine.scene
        if len(scene.frame_indices) == 1:
            return None
        text = f"{self.frame} of {scene.frame_indices[-1]}"
        fps = self._frame_rate.value if self._engine.playback.playing else None
        return text if fps is None else f"{text}, {fps:.2g} of {scene.source.fps:g} fps"

    @property
    def truth_problem(self) -> str | None:
        """Reason why no truth is available here; None if one is."""
        return truth_problem(self._engine.scene, self.name, self.frame)

    def _clock(self, shown: Shown) -> None:
        while self._asked and self._asked[0][0] <= shown.number:
            _, asked_s = self._asked.popleft()
            self._latency_s = self._time() - asked_s

    # Positions in the picture -----------------------------------------------------------------

    def readout(self, x: float, y: float) -> Readout | None:
        """Return the values of the pixel at a position; None without a picture or outside of it."""
        return self.picking.readout(
            x, y, None if self._displayed is None else self._displayed.buffer
        )

    def dropped(
        self, state: ObjectState, x: float, y: float, *, upright: bool
    ) -> NDArray[np.float64] | None:
        """Return an object's transform (4, 4) on the real surface at a position, if there is one.

        Parameters
        ----------
        state : ObjectState
        x, y : float
        upright : bool
            Keep the object's rotation. Otherwise align its +Y axis with the surface normal.
        """
        footprint = 0.25 * float(np.hypot(state.size[0], state.size[2]))
        surface = self.picking.ground(x, y, footprint, upright=upright)
        if surface is None:
            return None
        normal = None if upright else surface.normal
        return set_on(state.to_world, state.corners, surface.point, normal)

    def aim(self, x: float, y: float) -> tuple[float, float]:
        """Return yaw and pitch in degrees at a position, in capture-centre axes (`Engine.add`)."""
        shown = self._client.shown
        view = self.view if shown is None else shown.request.view
        pose = None if shown is None else shown.pose
        pixel = np.array([x * view.width, y * view.height])
        right, up, back = view_from(view, pose).unproject(pixel)
        return float(np.rad2deg(np.arctan2(right, -back))), float(np.rad2deg(np.arcsin(up)))

    # Files ------------------------------------------------------------------------------------

    def save(self, done: Callable[[str | None], object] = lambda _: None) -> None:
        """Write the scene's file, with this window's view (`Engine.save`)."""
        everything = self._objects is None or {state.name for state in self._engine.objects} <= set(
            self._objects
        )
        self._engine.save(done, Look(self.view, None if everything else self._objects))

    def screenshot(self, suffix: str, folder: Path | None = None) -> Path:
        """Write the displayed pixels (`.png`), or the linear picture and its buffer (`.exr`).

        Returns the absolute path of a new file in a folder, by default `default_folder()`.

        Raises
        ------
        IprtError
            There is no picture yet, or the file cannot be written.
        """
        displayed = self.poll()
        if displayed is None:
            raise IprtError("there is no picture yet")
        path = free_path(self._engine.scene.name, self.name, suffix, folder)
        write_screenshot(path, displayed, metadata_of(self._engine, displayed.shown))
        return path


def _fitted(view: View, width: int, height: int) -> View:
    """Return the view at a window's size; a whole panorama keeps its ratio of 2:1."""
    if view.projection == "equirect":
        width = min(width, 2 * height)
        height = max(width // 2, 1)
    return view.resized(width, height)
