"""What viewers ask for and are told: immutable, so that threads may share it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from iprt.scene.camera import View
from iprt.scene.edits import ObjectEdit
from iprt.settings import Settings

REST_FRAMES = 64
"""View frames to which a picture at rest is refined, as `iprt render` does with stills."""


@dataclass(frozen=True)
class Request:
    """What one client wants to see.

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


@dataclass(frozen=True)
class Playback:
    """Which frame of the video is shown, and when the next ones are due.

    Attributes
    ----------
    frame : int
        Its number, as scene.toml counts.
    since_s : float or None
        When it was shown, by the engine's clock; later frames follow. None: it stays.
    """

    frame: int
    since_s: float | None = None

    def due(self, now_s: float, fps: float) -> int:
        """Frames that should have followed `frame` by now."""
        return 0 if self.since_s is None else max(int((now_s - self.since_s) * fps), 0)

    def index(self, follower: int, frames: range, *, loop: bool) -> int:
        """Number of the frame that comes so many after `frame`: the last one where they end."""
        position = min(max(self.frame - frames[0], 0), len(frames) - 1) + follower
        return frames[position % len(frames) if loop else min(position, len(frames) - 1)]


@dataclass(frozen=True)
class World:
    """What all clients share.

    Attributes
    ----------
    settings : Settings
    playback : Playback
    edits : tuple of ObjectEdit
        At most one of each object.
    """

    settings: Settings
    playback: Playback
    edits: tuple[ObjectEdit, ...] = ()

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

    def without(self, done: tuple[ObjectEdit, ...]) -> World:
        """Without these edits, but with what has been edited since."""
        return replace(self, edits=tuple(edit for edit in self.edits if edit not in done))


Doing = Literal["loading", "compiling", "rendering", "waiting", "closed"]


@dataclass(frozen=True)
class Status:
    """What the engine does, and what went wrong.

    Attributes
    ----------
    doing : {"loading", "compiling", "rendering", "waiting", "closed"}
    what : str
        Which kernel is compiled, or what is loaded; empty otherwise.
    problems : tuple of str
        A line each; gone once it is solved.
    """

    doing: Doing = "loading"
    what: str = ""
    problems: tuple[str, ...] = ()
