"""Immutable requests and states of viewers, which threads may share."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

from iprt.geometry.camera import View
from iprt.geometry.keyframes import ViewMotion
from iprt.scene.light_edits import UNEDITED, LightEdit
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.view_edits import ViewEdit
from iprt.settings.model import Settings

REST_FRAMES = 64
"""Number of view frames to which a picture at rest is refined, as in `iprt render` for stills."""


@dataclass(frozen=True)
class Request:
    """A client's request for a picture.

    Attributes
    ----------
    view : View
        World-space view, with the size of the picture.
    objects : tuple of str or None
        Names of the shown objects; None for all.
    settings : Settings or None
        Replaces the world's settings, for speed or for a comparison.
    aovs : tuple of str
        Auxiliary pictures to render too, from `iprt.aovs.AOVS`.
    geometry : bool
        Read back `Shown.geometry`, for picking.
    frames : int
        View frames to which the picture is refined at rest; at least 1.
    motion : ViewMotion or None
        Turns the view as the video plays. The request of a picture has its view at that time.
    """

    view: View
    objects: tuple[str, ...] | None = None
    settings: Settings | None = None
    aovs: tuple[str, ...] = ()
    geometry: bool = True
    frames: int = REST_FRAMES
    motion: ViewMotion | None = field(default=None, hash=False)

    def at(self, time_s: float) -> Request:
        """Return the request with its view at a time of the video."""
        if self.motion is None:
            return self
        view = self.motion.at(time_s).resized(self.view.width, self.view.height)
        return replace(self, view=view)


PlaybackMode = Literal["real time", "every frame"]
"""Frames are shown at their times, or one after another without dropping any."""


@dataclass(frozen=True)
class Playback:
    """The playback state of the video.

    Attributes
    ----------
    frame : int
        Number of the first frame, as in scene.toml.
    since_s : float or None
        Time at which it was shown, by the engine's clock, if later frames follow; None when paused.
    mode : {"real time", "every frame"}
    loop : bool
        The first frame follows the last.
    """

    frame: int
    since_s: float | None = None
    mode: PlaybackMode = "real time"
    loop: bool = False

    @property
    def playing(self) -> bool:
        """True while the video plays."""
        return self.since_s is not None

    def due(self, now_s: float, fps: float) -> int:
        """Return the number of frames that should have followed `frame` by now, in real time."""
        return 0 if self.since_s is None else max(int((now_s - self.since_s) * fps), 0)

    def index(self, follower: int, frames: range) -> int:
        """Return the frame at an offset from `frame`, clamped to the last one or looped."""
        position = min(max(self.frame - frames[0], 0), len(frames) - 1) + follower
        return frames[position % len(frames) if self.loop else min(position, len(frames) - 1)]


@dataclass(frozen=True)
class World:
    """The state shared by all clients.

    Attributes
    ----------
    settings : Settings
    playback : Playback
    edits : tuple of ObjectEdit
        Differences from the scene's files as first read; at most one per object.
    light : LightEdit
        Differences of light and reflections.
    views : tuple of ViewEdit
        Differences of views; at most one per view.
    saved : tuple of ObjectEdit
        Edits that the files already contain.
    saved_light : LightEdit
        The same of light and reflections.
    saved_views : tuple of ViewEdit
        The same of views.
    """

    settings: Settings
    playback: Playback
    edits: tuple[ObjectEdit, ...] = ()
    light: LightEdit = UNEDITED
    views: tuple[ViewEdit, ...] = ()
    saved: tuple[ObjectEdit, ...] = ()
    saved_light: LightEdit = UNEDITED
    saved_views: tuple[ViewEdit, ...] = ()

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Names of the objects and views, and keys of `[video]`, that differ from the files."""
        changed = set(self.edits) ^ set(self.saved)
        names = dict.fromkeys(e.name for e in (*self.edits, *self.saved) if e in changed)
        known = {edit.name: edit.shown_name for edit in (*self.saved_views, *self.views)}
        differing = {edit.name for edit in set(self.views) ^ set(self.saved_views)}
        views = (f"view {shown}" for name, shown in known.items() if name in differing)
        return (*names, *views, *self.light.differing(self.saved_light))

    def edit_of(self, name: str) -> ObjectEdit:
        """Return the edit of an object; an empty one by default."""
        return next((edit for edit in self.edits if edit.name == name), ObjectEdit(name))

    def edited(self, name: str, **parts: Any) -> World:
        """Return the world with other values of these parts of an object's edit."""
        return self.having(replace(self.edit_of(name), **parts))

    def having(self, edit: ObjectEdit) -> World:
        """Return the world with another edit of an object."""
        others = {known.name: known for known in self.edits}
        return replace(self, edits=tuple((others | {edit.name: edit}).values()))

    def view_edited(self, name: str, **parts: Any) -> World:
        """Return the world with other values of these parts of the edit of a view, as named now."""
        known = (e for e in self.views if e.shown_name == name and not e.removed)
        edit = replace(next(known, ViewEdit(name)), **parts)
        others = {other.name: other for other in self.views}
        if edit.new and edit.removed:
            others.pop(edit.name)
        else:
            others[edit.name] = edit
        return replace(self, views=tuple(others.values()))

    def without(self, name: str) -> World:
        """Return the world without the edit of an object."""
        return replace(self, edits=tuple(edit for edit in self.edits if edit.name != name))


Doing = Literal["loading", "compiling", "rendering", "waiting", "closed"]


@dataclass(frozen=True)
class Status:
    """The engine's activity and problems.

    Attributes
    ----------
    doing : {"loading", "compiling", "rendering", "waiting", "closed"}
    what : str
        Kernel in compilation, or what is done in the background; else empty.
    problems : tuple of str
        A line each, until solved.
    notes : tuple of str
        Notes, a line each, shown for a while.
    built, to_build : int
        Compiled parts of the kernels, and all parts; 0 outside compilation.
    """

    doing: Doing = "loading"
    what: str = ""
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    built: int = 0
    to_build: int = 0

    @property
    def text(self) -> str:
        """Short description of the activity."""
        if self.doing == "compiling":
            return f"compiling {self.built} of {self.to_build}"
        if self.doing == "loading":
            return self.what or "loading"
        return {"waiting": "ready", "closed": "closed"}.get(self.doing, self.doing)
