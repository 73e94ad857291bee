"""Orders to workers, and their answers."""

from __future__ import annotations

from dataclasses import dataclass

RESOURCE = "iprt"
"""Resource of workers that render; a chunk takes one."""


@dataclass(frozen=True)
class Order:
    """A film whose chunks workers render.

    Attributes
    ----------
    words : tuple of str
        Words behind `iprt` that render it, see `iprt.commands.render_words`.
    scene : str
        Absolute path of the scene folder.
    allow_outside : bool
        See `Scene.open`.
    fingerprint : str
        See `iprt.scene.scene_files.fingerprint`.
    parts : str
        Absolute path of the folder of the film's parts.
    device : str or None
        See `choose_device`.
    space : int
        Bytes that must be free in the folder of parts.
    version : str
        The version of iprt that gives the order.
    topic : str
        Topic of the events that tell the progress.
    patience_s : float
        Seconds without a line from a render after which it counts as hung.
    """

    words: tuple[str, ...]
    scene: str
    allow_outside: bool
    fingerprint: str
    parts: str
    device: str | None
    space: int
    version: str
    topic: str
    patience_s: float


@dataclass(frozen=True)
class Outcome:
    """The end of a render of a chunk on a worker.

    Attributes
    ----------
    code : int
        Exit status; negative: the number of the signal that ended it.
    frames : int
        Frames that were rendered.
    seconds : float
        Time from the start of the process to its end.
    line : str
        Why it failed, in one line; else empty.
    remarks : tuple of str
        Other lines that it logged.
    """

    code: int
    frames: int
    seconds: float
    line: str = ""
    remarks: tuple[str, ...] = ()
