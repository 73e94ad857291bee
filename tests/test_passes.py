"""When passes run, and that what each names as read is there before it."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from unittest import mock

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.plan import PlanDevice
from iprt.device.profile import Profile
from iprt.footage.properties import Footage
from iprt.passes import Clock, Pass, Schedule
from iprt.renderer import Renderer
from tests.films import Film, films

FILMS = films()


class Log:
    """Passes whose runs are recorded by name."""

    def __init__(self) -> None:
        self.ran: list[str] = []

    def a_pass(
        self, name: str, clock: Clock, reads: tuple[str, ...] = (), writes: tuple[str, ...] = ()
    ) -> Pass[str]:
        return Pass(name, clock, lambda state: self.ran.append(f"{name} {state}"), reads, writes)

    def new(self) -> list[str]:
        ran, self.ran = self.ran, []
        return ran


def test_a_pass_runs_when_its_clock_or_what_it_reads_has_changed() -> None:
    log = Log()
    schedule = Schedule(
        [
            log.a_pass("depth", Clock.VIDEO, writes=("surfaces",)),
            log.a_pass("boxes", Clock.OBJECTS, writes=("hierarchy",)),
            log.a_pass("picture", Clock.VIEW, reads=("surfaces", "hierarchy")),
        ],
        Profile(),
    )
    schedule.walk("first")
    assert log.new() == ["depth first", "boxes first", "picture first"]
    schedule.walk("still")
    assert log.new() == []
    for clock, ran in (
        (Clock.VIDEO, ["depth 1", "picture 1"]),
        (Clock.OBJECTS, ["boxes 1", "picture 1"]),
        (Clock.VIEW, ["picture 1"]),
        (Clock.MOTION, []),
    ):
        schedule.tick(clock)
        schedule.walk("1")
        assert log.new() == ran


def test_views_of_one_world_run_its_passes_once() -> None:
    log = Log()
    world = Schedule([log.a_pass("depth", Clock.VIDEO, writes=("surfaces",))], Profile())
    views = [
        Schedule([log.a_pass(name, Clock.VIEW, ("surfaces",))], Profile(), world) for name in "ab"
    ]
    for frame in "12":
        world.tick(Clock.VIDEO)
        for view in views:
            world.walk(frame)
            view.walk(frame)
        assert log.new() == [f"depth {frame}", f"a {frame}", f"b {frame}"]
    views[0].tick(Clock.VIEW)
    for view in views:
        view.walk("3")
    assert log.new() == ["a 3"]


def test_what_was_abandoned_runs_again() -> None:
    log = Log()

    def fail(_: str) -> None:
        raise KeyboardInterrupt

    passes = [
        log.a_pass("depth", Clock.VIDEO, writes=("surfaces",)),
        Pass("lost", Clock.VIDEO, fail),
    ]
    schedule = Schedule(passes, Profile())
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            schedule.walk("1")
        assert not schedule.complete
    assert log.new() == ["depth 1"]


def planned(film: Film) -> Renderer:
    footage = Footage.of(film.video[0], static_camera=film.static_camera)
    view = film.view
    return Renderer(PlanDevice(), film.video[0], film.objects, view, film.settings, footage=footage)


def test_data_are_written_before_they_are_read() -> None:
    written_anywhere: set[str] = {"camera motion"}  # by the renderer, between frames
    read_anywhere: set[str] = set()
    for name, film in FILMS.items():
        renderer = planned(film)
        world = renderer.real_world
        passes = [*world.schedule.passes, *world.shown.passes, *renderer.schedule.passes]
        writes = set(chain.from_iterable(one.writes for one in passes))
        done: set[str] = set()
        for one in passes:
            done |= set(one.writes)
            early = (set(one.reads) & writes) - done
            assert not early, (name, one.name, early)
        written_anywhere |= writes
        read_anywhere |= set(chain.from_iterable(one.reads for one in passes))
    assert read_anywhere - set(Clock) <= written_anywhere


def test_highlights_are_split_in_frames_that_a_view_shows() -> None:
    """Not in frames that are only remembered, and once for all views."""
    film = next(film for film in FILMS.values() if planned(film).real_world.highlight is not None)
    world = planned(film).real_world
    assert world.highlight is not None
    with mock.patch.object(world.highlight, "run") as run:
        for frame in film.video[::-1]:
            world.load(replace(frame))
        assert run.call_count == 0
        world.prepare()
        world.prepare()
    assert run.call_count == 1


OWN_PROGRAMS = ("covers", "glass", "lamps", "maps", "virtual lights", "layers around", "remembered")
"""Films with passes of others, in programs of their own."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.thorough if name in OWN_PROGRAMS else ())
        for name, film in FILMS.items()
        if film.settings.method != "oil"
    ],
)
def test_a_pass_that_is_not_due_would_change_nothing(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Pictures in which all passes run in each frame: equal. (`oil` learns at each run.)"""
    film, walk = FILMS[name], Schedule.walk

    def forgetful(self: Schedule[object], state: object) -> None:
        self._seen.clear()
        walk(self, state)

    pictures = []
    for how in (walk, forgetful):
        monkeypatch.setattr(Schedule, "walk", how)
        footage = Footage.of(film.video[0], static_camera=film.static_camera)
        given = (device, film.video[0], film.objects, film.view, film.settings)
        with Renderer(*given, footage=footage) as renderer:
            shown = [renderer.render(2).color]
            renderer.load(film.video[1])
            shown.append(renderer.render(2).color)
        pictures.append(np.array(shown))
    np.testing.assert_array_equal(*pictures)
