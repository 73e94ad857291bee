"""Passes of a frame, and the versions that tell which of them must run.

Everything that a pass reads or writes has a name and a version. A pass runs when its clock, or
something that it reads, has another version than at its last run. Nothing else decides that.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Generic, TypeVar

from iprt.device.profile import Profile

State = TypeVar("State")


class Clock(StrEnum):
    """Sources of change."""

    VIDEO = "video"
    """Another frame of the video."""
    OBJECTS = "objects"
    """Objects have other positions."""
    MOTION = "motion"
    """Objects have other positions, or had other ones in the frame before."""
    VIEW = "view"
    """The camera has turned, or stopped since the frame before. So has a moving 360° camera."""
    FRAME = "frame"
    """Every view frame."""


@dataclass(frozen=True, eq=False)
class Pass(Generic[State]):
    """Pass of a frame.

    Attributes
    ----------
    name : str
        Row of the profile, which passes may share.
    clock : Clock
    run : callable
        Does the work, given the state of the frame.
    reads, writes : tuple of str
        Names of data.
    """

    name: str
    clock: Clock
    run: Callable[[State], None]
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()


class Schedule(Generic[State]):
    """Passes in the order in which they run.

    Parameters
    ----------
    passes : iterable of Pass
    profile : Profile
    below : Schedule or None
        Schedule whose data these passes may read, such as the shared world's.

    Attributes
    ----------
    passes : tuple of Pass
    versions : mapping of str to int
        Versions of clocks and data.
    complete : bool
        The last walk reached its end.
    """

    def __init__(
        self,
        passes: Iterable[Pass[State]],
        profile: Profile,
        below: Schedule[Any] | None = None,
    ) -> None:
        self.passes = tuple(passes)
        self.versions: ChainMap[str, int] = ChainMap({})
        if below is not None:
            self.versions.maps += below.versions.maps
        self.complete = True
        self._profile = profile
        self._seen: dict[Pass[State], tuple[int, ...]] = {}

    def tick(self, name: str) -> None:
        """Begin another version of a clock or of data."""
        self.versions[name] = self.versions.get(name, 0) + 1

    def walk(self, state: State) -> None:
        """Run the passes that are due. An abandoned walk leaves them due."""
        self.complete = False
        for one in self.passes:
            seen = tuple(self.versions.get(name, 0) for name in (one.clock, *one.reads))
            if self._seen.get(one) == seen:
                continue
            with self._profile.section(one.name):
                one.run(state)
            self._seen[one] = seen
            for name in one.writes:
                self.tick(name)
        self.complete = True
