"""Profiles of made-up frames: events whose times are known."""

from __future__ import annotations

from collections.abc import Mapping

from iprt.device.profile import END, QUEUED, START, Kind, Profile

MS = 1_000_000
"""Nanoseconds."""


class FakeEvent:
    """Times of a launch, in nanoseconds of the device's own clock."""

    def __init__(self, start: int, end: int, queued: int = 0) -> None:
        self._times = {QUEUED: queued, START: start, END: end}

    def get_profiling_info(self, what: int) -> int:
        return self._times[what]


def launch(
    profile: Profile, place: str, name: str, ms: float, size: int = 0, kind: Kind = Kind.KERNEL
) -> None:
    """Something of the pass `place` that takes `ms` on the device."""
    with profile.section(place):
        profile.record(FakeEvent(0, round(ms * MS)), name, kind, size)


def frame(profile: Profile, times: Mapping[str, float]) -> None:
    """A frame of passes with one kernel each, of the same name."""
    for name, ms in times.items():
        launch(profile, name, name, ms)
    profile.end_frame()
