"""Chunks of films: the same files, whoever renders which of them in whatever order."""

from __future__ import annotations

import random
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iprt.errors import FormatError, IprtError
from iprt.files.exr import read_exr_depth
from iprt.files.images import read_color
from iprt.output.chunks import Chunks, chunk_numbers, chunk_ranges, warm_up
from iprt.output.film_plan import FilmPlan
from iprt.output.parts import PLAN
from iprt.output.sound import Sound
from iprt.renderer import RenderedFrame
from tests.output.films import RATE, contents, opened, picture, plan, render, whole

THERE = range(3, 50)
ALL = plan(THERE, there=THERE, chunk=12, warm_up=4)


@st.composite
def films(draw: st.DrawFn) -> Chunks:
    """Parts of videos, in steps."""
    first, count = draw(st.integers(0, 40)), draw(st.integers(1, 90))
    there = range(first, first + count)
    start = draw(st.sampled_from(there))
    last = draw(st.sampled_from(range(start, there.stop)))
    frames = range(start, last + 1, draw(st.integers(1, 7)))
    before = draw(st.integers(1, 9))
    return Chunks(there, frames, before + draw(st.integers(0, 20)), before)


@given(films())
def test_each_frame_has_one_chunk_and_fades_have_two(chunks: Chunks) -> None:
    there, frames = chunks.there, chunks.frames
    every = [i for i in there if i % frames.step == frames[0] % frames.step]
    numbers = range(every[-1] // frames.step // chunks.length + 1)
    assert [i for number in numbers for i in chunks.frames_of(number)] == every
    for number in numbers:
        assert chunks.lead(number) == chunks.tail(number - 1)
        tail, of = chunks.tail(number), chunks.frames_of(number)
        assert bool(tail) == bool(of and number < numbers[-1])
        assert list(tail) == list(of)[-len(tail) :] if tail else True
        assert len(tail) <= max(chunks.warm_up // 2, 1)
        shares = [chunks.share(index) for index in tail]
        assert all(0.0 < share < 1.0 for share in shares)
        assert shares == sorted(shares)
    needed = {
        number
        for number in numbers
        for index in (*chunks.lead(number), *chunks.frames_of(number))
        if index in frames
    }
    assert list(chunks.numbers) == sorted(needed)


@given(films(), st.data())
def test_chunks_are_cut_alike_whatever_is_rendered(chunks: Chunks, data: st.DataObject) -> None:
    first = data.draw(st.sampled_from(chunks.frames))
    last = data.draw(st.sampled_from(range(first, chunks.frames.stop)))
    part = range(first, last + 1, chunks.frames.step)
    other = Chunks(chunks.there, part, chunks.length, chunks.warm_up)
    for number in other.numbers:
        assert other.frames_of(number) == chunks.frames_of(number)
        assert other.tail(number) == chunks.tail(number)
        assert [*map(other.share, other.tail(number))] == [*map(chunks.share, chunks.tail(number))]


def test_a_fade_is_even() -> None:
    chunks = ALL.chunks
    assert list(chunks.frames_of(1)) == list(range(12, 24))
    assert list(chunks.tail(1)) == [22, 23], "the second half of the next warm-up"
    assert [round(3.0 * chunks.share(index), 9) for index in chunks.tail(1)] == [1.0, 2.0]
    assert list(chunks.frames_of(0)) == list(range(3, 12)), "from the video's first frame"


def test_warm_ups_are_as_long_as_histories() -> None:
    assert [warm_up(each) for each in (1, 2, 3, 4, 64)] == [16, 8, 8, 8, 8]
    with pytest.raises(IprtError, match="--chunk 7: expected at least 8, the frames of a warm-up"):
        Chunks(THERE, THERE, 7, 8)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [("3", (3,)), ("0-2", (0, 1, 2)), ("4,0-1, 4", (0, 1, 4)), ("0-4", (0, 1, 2, 3, 4))],
)
def test_numbers_of_chunks(text: str, numbers: tuple[int, ...]) -> None:
    assert chunk_numbers(text, range(5)) == numbers
    assert chunk_numbers(chunk_ranges(numbers), range(5)) == numbers


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5", "there is no chunk 5; the film has 0 to 4"),
        ("2-9", "there is no chunk 9"),
        ("3-1", "3-1 is empty; the lower number is first"),
        ("", "expected numbers and ranges, such as 0-3,8"),
        ("1,", "expected numbers"),
        ("-1", "expected numbers"),
        ("1-", "expected numbers"),
        ("\u0663", "expected numbers"),
        ("1" * 12, "expected numbers"),
    ],
)
def test_bad_numbers_of_chunks(text: str, message: str) -> None:
    with pytest.raises(IprtError, match=message):
        chunk_numbers(text, range(5))


@pytest.mark.parametrize("name", ["a.mp4", "%d.exr", "%02d.png"])
def test_order_and_number_of_processes_change_no_byte(name: str, tmp_path: Path) -> None:
    """Each chunk by a process of its own, in three orders; and twice at the same time."""
    expected = contents(whole(tmp_path / "whole" / name, ALL).parent)
    for seed in range(3):
        path = tmp_path / str(seed) / name
        numbers = [*ALL.chunks.numbers, 2, 4]
        random.Random(seed).shuffle(numbers)
        outputs = [opened(path, ALL, number) for number in numbers]
        for target in outputs:
            render(target)
        target = opened(path, ALL)
        assert target.complete
        target.finish()
        assert contents(path.parent) == expected


@pytest.mark.thorough
def test_a_thousand_tasks_of_one_chunk_each_change_no_byte(tmp_path: Path) -> None:
    frames = range(2000)
    long = plan(frames, there=frames, chunk=2, warm_up=2, rate=Fraction(24))
    expected = contents(whole(tmp_path / "whole" / "a.mp4", long).parent)
    path = tmp_path / "apart" / "a.mp4"
    numbers = [*long.chunks.numbers]
    assert len(numbers) == 1000
    random.Random(0).shuffle(numbers)
    for number in numbers:
        render(opened(path, long, number))
    opened(path, long).finish()
    assert contents(path.parent) == expected


@pytest.mark.parametrize("name", ["%d.exr", "%02d.png"])
def test_ranges_change_no_byte(name: str, tmp_path: Path) -> None:
    expected = contents(whole(tmp_path / "whole" / name, ALL).parent)
    for frames in (range(10, 11), range(18, 23), range(20, 40), THERE):
        path = tmp_path / f"{frames}" / name
        part = plan(frames, there=THERE, chunk=12, warm_up=4)
        got = contents(whole(path, part).parent)
        assert len(got) == len(frames)
        assert got.items() <= expected.items()


def test_a_fade_has_the_mean_of_both_sides(tmp_path: Path) -> None:
    path = whole(tmp_path / "%d.exr", ALL)
    for index in THERE:
        number = index // 12
        blue = picture(index, number).color[0, 0, 2]
        if index in ALL.chunks.tail(number):
            blue += 0.01 * ALL.chunks.share(index)
        assert read_color(path.parent / f"{index}.exr")[0, 0, 2] == pytest.approx(blue, abs=1e-6)


def test_layers_fade_and_the_sky_stays_infinitely_far(tmp_path: Path) -> None:
    target = opened(tmp_path / "%d.exr", ALL, 0, 1)
    for number in target.numbers:
        for index in target.missing(number):
            depth = np.full((16, 32), 2.0 + number, np.float32)
            depth[0], depth[1] = np.inf, 0.1
            layers = {"depth": depth}
            color = picture(index, number).color
            target.write(number, index, RenderedFrame(color, layers), "a device")
        target.fade(number)
    depth = read_exr_depth(tmp_path / "11.exr", "depth.Z")
    assert np.all(np.isposinf(depth[0]))
    assert np.all(depth[1] == np.float32(0.1)), "equal sides, to the bit"
    assert depth[2, 0] == pytest.approx(2.0 + ALL.chunks.share(11))


def test_damaged_sides_are_named(tmp_path: Path) -> None:
    render(opened(tmp_path / "a.mp4", ALL, 0))
    side = next(opened(tmp_path / "a.mp4", ALL, 1).parts.path.glob("*.tail.npz"))
    side.write_bytes(side.read_bytes()[:100])
    with pytest.raises(FormatError, match=r"tail\.npz: is damaged; delete it"):
        render(opened(tmp_path / "a.mp4", ALL, 1))


def test_plans_are_kept_as_they_are(tmp_path: Path) -> None:
    sound = Sound(tmp_path / "a.mkv", RATE, 3 * RATE)
    for given_plan in (ALL, plan(sound=sound)):
        assert FilmPlan.from_json(given_plan.to_json()) == given_plan
    for text in ("", "[]", "{}", ALL.to_json().replace("identity", "name")):
        with pytest.raises(ValueError, match=r"no plan|Expecting"):
            FilmPlan.from_json(text)


def test_devices_that_differ_are_told(tmp_path: Path) -> None:
    parts = opened(tmp_path / "a.mp4", ALL).parts
    assert (parts.path / PLAN).exists()
    assert parts.other_device("first") is None
    assert parts.other_device("first") is None
    assert parts.other_device("second") == "first"
