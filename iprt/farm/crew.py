"""The workers that render a film, as its client knows them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from iprt.farm.order import RESOURCE

State = Literal["examined", "free", "busy", "out", "gone"]
STRIKES = 3
"""Failures in a row after which a worker gets no more chunks, while there are others."""


@dataclass
class Worker:
    """A worker of the cluster.

    Attributes
    ----------
    address, name : str
    state : {"examined", "free", "busy", "out", "gone"}
        `examined` while it is; `out` if it gets no chunks.
    device : str
    strikes : int
        Chunks that failed since the last one that did not.
    chunk : int or None
        The chunk that it renders.
    done : int
        Finished frames of this chunk.
    future : Future or None
        The task that it has.
    heard : float or None
        Time of its last message about this chunk; None if it has not begun.
    frames : int
        Frames that it has rendered.
    since : float
        When its first chunk began, by the monotonic clock.
    """

    address: str
    name: str
    state: State = "examined"
    device: str = ""
    strikes: int = 0
    chunk: int | None = None
    done: int = 0
    future: Any = None
    heard: float | None = None
    frames: int = 0
    since: float | None = None
    _first: int | None = field(default=None, repr=False)

    @property
    def works(self) -> bool:
        """True if it renders or waits for a chunk."""
        return self.state in ("free", "busy")

    @property
    def rate(self) -> float | None:
        """Frames a second since its first chunk began; None if it has finished none."""
        if self.since is None or not self.frames:
            return None
        return self.frames / max(time.monotonic() - self.since, 1e-6)

    def begin(self, chunk: int, future: Any) -> None:
        """Note a chunk that it has been given."""
        self.state, self.chunk, self.future = "busy", chunk, future
        self.done, self.heard, self._first = 0, None, None

    def advance(self, done: int) -> None:
        """Note finished frames of its chunk, which may have been there before it began."""
        now = time.monotonic()
        self.heard = now
        if self.since is None:
            self.since = now
        if self._first is None:
            self._first = done
        elif done > self.done:
            self.frames += done - max(self.done, self._first)
        self.done = done

    def end(self) -> None:
        """Note the end of its task."""
        self.future = self.chunk = None
        if self.state == "busy":
            self.state = "free"


def tagged(info: Mapping[str, Any]) -> bool:
    """Return whether a worker's description by the scheduler has the resource tag."""
    return float(info.get("resources", {}).get(RESOURCE, 0)) >= 1
