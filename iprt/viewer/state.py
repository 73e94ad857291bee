"""Requests and answers of viewers: immutable, so that threads may share them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from iprt.geometry.camera import View
from iprt.scene.edits import ObjectEdit
from iprt.settings.model import Settings

REST_FRAMES = 64
"""View frames to which a picture at rest is refined, as `iprt render` does with stills."""


@dataclass(frozen=True)
class Request:
    """The picture that one client asks for.

    Attributes
    ----------
    view : View
        Where it looks, in the world, and how large the picture is.
    objects : tuple of str or None
        Names of the objects that it shows. None: all.
    settings : Settings or None
        In place of the world's: to be quicker for a while, or to compare with.
    aovs : tuple of str
        Auxiliary pictures that come with the picture, of `iprt.aovs.AOVS`.
    geometry : bool
        Whether `Shown.geometry` comes with it, to point at things.
    frames : int
        View frames to which the picture is refined while nothing moves; at least 1.
    """

    view: View
    objects: tuple[str, ...] | None = None
    settings: Settings | None = None
    aovs: tuple[str, ...] = ()
    geometry: bool = True
    frames: int = REST_FRAMES


PlaybackMode = Literal["real time", "every frame"]
"""Frames are shown when they are due, or each after the one before, however long that takes."""


@dataclass(frozen=True)
class Playback:
    """Which frame of the video is shown, and which ones follow when.

    Attributes
    ----------
    frame : int
        Its number, as scene.toml counts.
    since_s : float or None
        When it was shown, by the engine's clock; later frames follow. None: it stays.
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
        return self.since_s is not None

    def due(self, now_s: float, fps: float) -> int:
        """Frames that should have followed `frame` by now, in real time."""
        return 0 if self.since_s is None else max(int((now_s - self.since_s) * fps), 0)

    def index(self, follower: int, frames: range) -> int:
        """Number of the frame that comes so many after `frame`: the last one where they end."""
        position = min(max(self.frame - frames[0], 0), len(frames) - 1) + follower
        return frames[position % len(frames) if self.loop else min(position, len(frames) - 1)]


@dataclass(frozen=True)
class World:
    """The state that all clients share.

    Attributes
    ----------
    settings : Settings
    playback : Playback
    edits : tuple of ObjectEdit
        At most one of each object; how it differs from what the scene's files said first.
    saved : tuple of ObjectEdit
        Those that the files have by now.
    """

    settings: Settings
    playback: Playback
    edits: tuple[ObjectEdit, ...] = ()
    saved: tuple[ObjectEdit, ...] = ()

    @property
    def unsaved(self) -> tuple[str, ...]:
        """Names of the objects that are not as the files have them."""
        changed = set(self.edits) ^ set(self.saved)
        return tuple(dict.fromkeys(e.name for e in (*self.edits, *self.saved) if e in changed))

    def edit_of(self, name: str) -> ObjectEdit:
        """How the object of that name differs."""
        return next((edit for edit in self.edits if edit.name == name), ObjectEdit(name))

    def edited(self, edit: ObjectEdit) -> World:
        """With another edit of an object."""
        if any(known.name == edit.name for known in self.edits):
            edits = tuple(edit if known.name == edit.name else known for known in self.edits)
        else:
            edits = (*self.edits, edit)
        return replace(self, edits=edits)


Doing = Literal["loading", "compiling", "rendering", "waiting", "closed"]


@dataclass(frozen=True)
class Status:
    """The engine's work, and its errors.

    Attributes
    ----------
    doing : {"loading", "compiling", "rendering", "waiting", "closed"}
    what : str
        Which kernel is compiled, or what is loaded; empty otherwise.
    problems : tuple of str
        A line each; gone once it is solved.
    notes : tuple of str
        News that are no problem, a line each; shown for a while.
    built, to_build : int
        Parts of the kernels that are compiled already, and all of them; 0 if none are.
    """

    doing: Doing = "loading"
    what: str = ""
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    built: int = 0
    to_build: int = 0

    @property
    def text(self) -> str:
        """The engine's work, in a few words."""
        if self.doing == "compiling":
            return f"compiling {self.built} of {self.to_build}"
        if self.doing == "loading":
            return f"loading {self.what}".rstrip()
        return {"waiting": "ready", "closed": "closed"}.get(self.doing, self.doing)
