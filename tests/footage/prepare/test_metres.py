"""Values that mark missing depth are found, or given; rooms, walls and steps have none."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.footage.prepare.enlarge import at_full_size
from iprt.footage.prepare.metres import StoredDepth, find_marks
from iprt.footage.prepare.remarks import depth_doubts
from iprt.footage.prepare.steady import steady_frames
from iprt.footage.video.depth_code import (
    UNMEASURED,
    DepthCode,
    DepthMarks,
    DepthSamples,
    cube_factor,
)
from iprt.scene.scene import Scene
from tests.footage.video.encoding import grey16, write_video
from tests.scene.files import box_room, directions, write_channels, write_png16_grey

ROOM = box_room(256, 128)[0]
HOLE = np.zeros(ROOM.shape, bool)
HOLE[50:70, 100:140] = True
EVEN = np.arange(ROOM.size).reshape(ROOM.shape) % 2 == 0
PATH = Path("d.exr")
MM = DepthCode(0.001)


def floats(values: NDArray[Any]) -> DepthSamples:
    return DepthSamples(values.astype(np.float32), 0.0, 1.0, 0, exact=True)


def integers(values: NDArray[Any], bits: int = 16, *, exact: bool = True) -> DepthSamples:
    rounded = np.rint(values).astype(np.float32)
    return DepthSamples(rounded, 0.0, 2.0**bits - 1.0, bits, exact)


def marked(depth: NDArray[Any], value: float) -> NDArray[Any]:
    return np.where(HOLE, value, depth)


@pytest.mark.parametrize(
    ("samples", "code", "values"),
    [
        (integers(marked(1000 * ROOM, 65535)), MM, [65535]),
        (integers(marked(13_000 * ROOM, 65535)), DepthCode(1e-4), [65535]),  # up to 62000
        (integers(marked(100 * ROOM, 65535)), DepthCode(0.01), [65535]),  # few values
        (integers(marked(1000 * ROOM, 50_000)), MM, [50_000]),
        (floats(marked(ROOM, 1e10)), DepthCode(), [1e10]),
        (floats(marked(ROOM, 65504)), DepthCode(), [65504]),
        (floats(np.where(HOLE & EVEN, 1e4, marked(ROOM, 1e10))), DepthCode(), [1e10, 1e4]),
        (floats(marked(ROOM / 10, 1.0)), DepthCode(None, (1e-9, 10.0)), [1.0]),
    ],
)
def test_what_stands_out_is_a_mark(
    samples: DepthSamples, code: DepthCode, values: list[float]
) -> None:
    found = find_marks(samples, code)
    assert [mark.value for mark in found] == pytest.approx(values)
    stored = StoredDepth.of(PATH, samples, code)
    assert len(stored.doubts) == len(values)
    assert f"{values[0]:.9g} stands in " in stored.doubts[0]
    assert f"{HOLE.mean():.2%} of the pixels of d.exr" in stored.doubts[0] or len(values) > 1
    assert np.isinf(stored.metres(PATH, samples, code)[HOLE]).all()


@pytest.mark.parametrize(
    ("samples", "code"),
    [
        (integers(1000 * ROOM), MM),
        (integers(np.minimum(20_000 * ROOM, 65535)), DepthCode(5e-5)),  # clipped, no gap
        (integers(marked(1000 * ROOM, 65535), exact=False), MM),
        (integers(255 * ROOM / ROOM.max(), 8), DepthCode(None, (1e-9, 4.0))),
        (integers(marked(50 * ROOM, 255), 8), DepthCode(0.02)),
        (integers(257 * np.rint(marked(50 * ROOM, 255))), DepthCode(1e-4)),  # was of 8 bits
        (floats(marked(ROOM, ROOM.max() * 1.2)), DepthCode()),  # a dome slightly beyond
        (floats(marked(ROOM, ROOM.max() * 9.0)), DepthCode()),
        (floats(np.full(ROOM.shape, 1e10)), DepthCode()),
        (floats(np.where(np.arange(ROOM.size).reshape(ROOM.shape) < 9, 1e10, ROOM)), DepthCode()),
        (floats(marked(ROOM, np.nan)), DepthCode()),
        (floats(marked(ROOM, np.inf)), DepthCode()),
        (floats(marked(ROOM, -1.0)), DepthCode()),
        (floats(np.zeros(ROOM.shape)), DepthCode()),
        # The nearest value, to which many surfaces may be clipped.
        (integers(np.where(HOLE, 65535, 60_000 / ROOM)), DepthCode(None, (9.0, 0.5), "inverse")),
    ],
)
def test_what_does_not_is_none(samples: DepthSamples, code: DepthCode) -> None:
    assert find_marks(samples, code) == []


def test_given_values_replace_what_is_found() -> None:
    samples = integers(marked(1000 * ROOM, 65535))
    for marks, shown in (
        (DepthMarks(invalid=(65535.0,)), UNMEASURED),
        (DepthMarks(sky=(65535.0,)), np.inf),
        (DepthMarks(), np.float32(65.535)),
    ):
        code = DepthCode(0.001, marks=marks)
        stored = StoredDepth.of(PATH, samples, code)
        assert stored.doubts == ()
        metres = stored.metres(PATH, samples, code)
        assert (metres[HOLE] == shown).all()
        assert metres[~HOLE] == pytest.approx(ROOM[~HOLE], abs=0.0006)
    assert (samples.values[HOLE] == 65535).all(), "the samples may be kept for other frames"


def test_marks_of_every_kind_of_number() -> None:
    values = np.array([[np.nan, -1.0, 0.0, 3.0]], np.float32)
    marks = DepthMarks(invalid=(np.nan, -1.0), sky=(0.0,))
    metres = DepthCode().decoded(PATH, DepthSamples(values, 0.0, 1.0, 0, True), marks)
    assert metres.tolist() == [[UNMEASURED, UNMEASURED, np.inf, 3.0]]
    wide = np.array([[2**32 - 1, 7]], np.uint32).astype(np.float32)
    found = DepthMarks(sky=(2.0**32 - 1,)).masks(wide)[0][0]
    assert found.tolist() == [[True, False]]


def test_a_mark_is_no_fault_of_a_range() -> None:
    values = marked(ROOM / 10, 1e10)
    code = DepthCode(None, (0.5, 10.0))
    assert StoredDepth.of(PATH, floats(values), code).marks.sky == (np.float32(1e10),)
    with pytest.raises(FormatError, match="stores floats up to 1e"):
        StoredDepth.of(PATH, floats(values), DepthCode(None, (0.5, 10.0), marks=DepthMarks()))


def test_marks_survive_enlargement() -> None:
    coarse = np.where(HOLE, np.float32(UNMEASURED), ROOM.astype(np.float32))
    full = at_full_size(coarse, None, 512, 256)
    holes = ~(full > 0.0)
    assert holes.any()
    assert (full[holes] == np.float32(UNMEASURED)).mean() > 0.9


def test_a_cube_has_its_distances() -> None:
    part = np.abs(directions(256, 128)).max(axis=-1)
    assert cube_factor(128, 256) == pytest.approx(1.0 / part, rel=1e-5)
    code = DepthCode(kind="cube")
    samples = floats(ROOM * part)
    metres = StoredDepth.of(PATH, samples, code).metres(PATH, samples, code)
    assert metres == pytest.approx(ROOM, rel=1e-5)


def test_a_cube_of_repeated_texels_has_distances_of_these() -> None:
    part = np.abs(directions(256, 128)).max(axis=-1)
    code = DepthCode(kind="cube")
    samples = floats((ROOM * part).repeat(2, axis=0).repeat(2, axis=1))
    stored = StoredDepth.of(PATH, samples, code)
    assert stored.grid is not None
    assert stored.grid.size == (256, 128)
    assert stored.grid.coarse(stored.metres(PATH, samples, code)) == pytest.approx(ROOM, rel=1e-5)


@pytest.mark.parametrize(
    ("code", "step_m"),
    [
        (DepthCode(0.02), 0.02),
        # d = 1 / (0.1 + v / 255 * 1.9): its slope is d^2 * 1.9 / 255.
        (DepthCode(None, (10.0, 0.5), "inverse"), np.median(ROOM) ** 2 * 1.9 / 255),
    ],
)
def test_steps_of_8_bits_are_told(code: DepthCode, step_m: float) -> None:
    values = 50 * ROOM if code.scale else (1 / ROOM - 0.1) / 1.9 * 255
    (line,) = StoredDepth.of(Path("d.png"), integers(values, 8), code).doubts
    assert line.startswith("depth: d.png has 8 bits: at the median depth, 1.9")
    told = float(line.partition("one step is ")[2].partition(" cm")[0])
    assert told == pytest.approx(100 * step_m, rel=0.1)


def two_frames(folder: Path, depth: str) -> Scene:
    """Return a scene of two grey pictures; its depth is in millimetres."""
    for index in range(2):
        Image.new("RGB", (256, 128), (90, 120, 60)).save(folder / f"c{index}.png")
    (folder / "scene.toml").write_text(
        f'format = 1\nname = "a"\n[video]\ncolor = "c%d.png"\ndepth = "{depth}"\nframes = [0, 1]\n'
        "depth_scale = 0.001\n"
    )
    return Scene.open(folder)


@pytest.mark.parametrize("name", ["d.mkv", "d%d.png"])
def test_the_first_frame_decides(
    name: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    codes = [marked(1000 * ROOM, value).astype(np.uint16) for value in (65535, 40_000)]
    codes[1][0, 0] = 65535
    if name == "d.mkv":
        write_video(tmp_path / name, grey16(codes))
    else:
        for index, values in enumerate(codes):
            write_png16_grey(tmp_path / f"d{index}.png", values)
    scene = two_frames(tmp_path, name)
    second, first = scene.raw_frame(1).depth, scene.raw_frame(0).depth
    assert np.isinf(first[HOLE]).all()
    assert np.isinf(second[0, 0])
    assert (second[HOLE] == 40).all()
    with caplog.at_level(logging.WARNING):
        list(steady_frames(scene.raw_frames, [0, 1], strict=True))
    assert [record.message for record in caplog.records] == depth_doubts(scene.raw_frames)
    assert len(caplog.records) == 1


def test_a_hole_that_was_not_measured_is_filled_and_no_window(tmp_path: Path) -> None:
    write_channels(tmp_path / "d.exr", Z=marked(ROOM, 1e10).astype(np.float32))
    Image.new("RGB", (256, 128), (90, 120, 60)).save(tmp_path / "c.png")
    head = 'format = 1\nname = "a"\n[video]\ncolor = "c.png"\ndepth = "d.exr"\n'
    for keys, is_window in (("", True), ("depth_invalid = [1e10]\n", False)):
        (tmp_path / "scene.toml").write_text(head + keys)
        frame = Scene.open(tmp_path).frame()
        assert frame.opening[HOLE].all() == is_window
        assert frame.opening.any() == is_window
        assert frame.depth[HOLE] == pytest.approx(ROOM[HOLE], rel=0.2)
