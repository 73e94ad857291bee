"""Bad frames in the middle of a video: what stands in for them, and what the log tells."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iprt.errors import FormatError, SceneError
from iprt.footage.frame import Frame
from iprt.footage.prepare.remarks import video_notices
from iprt.scene.scene import Scene
from tests.footage.video.test_stream import write_video
from tests.scene.files import write_channels, write_rgb

Spoil = Callable[[Path], object]


def cut_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def other_size(path: Path, shape: tuple[int, int] = (2, 4), value: float = 9.0) -> None:
    plane = np.full(shape, value, np.float32)
    if path.name.startswith("c"):
        write_rgb(path, np.repeat(plane[..., None], 3, axis=-1))
    else:
        write_channels(path, Z=plane)


SPOILT: dict[str, Spoil] = {
    "missing": lambda path: path.unlink(),
    "cut off": cut_off,
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("no picture"),
    "of another size": other_size,
    "without a value": lambda path: other_size(path, (4, 8), np.nan),
}


def played(
    folder: Path, caplog: pytest.LogCaptureFixture, indices: list[int] | None = None
) -> tuple[list[Frame], list[str]]:
    """All frames of a video, and what the log tells meanwhile."""
    scene = Scene.open(folder)
    with (
        caplog.at_level(logging.WARNING, "iprt"),
        scene.stream(indices or scene.frame_indices) as stream,
    ):
        frames = list(stream)
    return frames, [record.getMessage() for record in caplog.records]


def values(frames: list[Frame]) -> list[tuple[int, float, float]]:
    return [(f.index, float(f.color[0, 0, 0]), float(f.depth[0, 0])) for f in frames]


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_bad_depth_is_held_and_color_goes_on(
    spoil: Spoil, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_video(tmp_path, 6)
    for index in (3, 4):
        spoil(tmp_path / f"d.{index:03}.exr")
    frames, told = played(tmp_path, caplog)
    assert values(frames) == [(1, 1, 1), (2, 2, 2), (3, 3, 2), (4, 4, 2), (5, 5, 5), (6, 6, 6)]
    assert frames[3].depth is frames[1].depth
    assert frames[3].opening is frames[1].opening
    assert len(told) == 2
    assert "d.003.exr: " in told[0]
    assert told[0].endswith("; depth of frame 2 stays until one is good")
    assert told[1] == "frame 5: good again, after 2 bad frames"


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_where_color_is_bad_the_last_good_frame_stays(
    spoil: Spoil, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_video(tmp_path, 4)
    spoil(tmp_path / "c.003.exr")
    frames, told = played(tmp_path, caplog)
    assert values(frames) == [(1, 1, 1), (2, 2, 2), (3, 2, 2), (4, 4, 4)]
    assert len(told) == 2
    assert "c.003.exr: " in told[0]
    assert told[0].endswith("; frame 2 is shown until one is good")


def test_a_run_of_differing_faults_is_one_incident(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_video(tmp_path, 6)
    cut_off(tmp_path / "d.002.exr")
    (tmp_path / "c.003.exr").unlink()
    other_size(tmp_path / "d.004.exr")
    frames, told = played(tmp_path, caplog)
    assert values(frames) == [(1, 1, 1), (2, 2, 1), (3, 2, 1), (4, 4, 1), (5, 5, 5), (6, 6, 6)]
    assert len(told) == 2
    assert told[1] == "frame 5: good again, after 3 bad frames"


def test_a_run_up_to_the_end_is_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_video(tmp_path, 4)
    for index in (3, 4):
        cut_off(tmp_path / f"d.{index:03}.exr")
    _, told = played(tmp_path, caplog)
    assert told[1:] == ["bad up to the last frame: 2 frames"]


def test_a_film_resumed_on_a_bad_frame_shows_what_it_would_have(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_video(tmp_path, 6)
    cut_off(tmp_path / "d.003.exr")
    cut_off(tmp_path / "d.004.exr")
    cut_off(tmp_path / "c.005.exr")
    whole, _ = played(tmp_path, caplog)
    for first in range(3, 7):
        resumed, _ = played(tmp_path, caplog, list(range(first, 7)))
        assert values(resumed) == values(whole)[first - 1 :]


def test_nothing_stands_in_for_the_first_frame(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_video(tmp_path, 3)
    cut_off(tmp_path / "d.001.exr")
    with pytest.raises(FormatError, match=r"d\.001\.exr: "):
        played(tmp_path, caplog)


def test_strict_stops_instead(tmp_path: Path) -> None:
    write_video(tmp_path, 4)
    cut_off(tmp_path / "d.003.exr")
    scene = Scene.open(tmp_path)
    with (
        pytest.raises(FormatError, match=r"d\.003\.exr: "),
        scene.stream(scene.frame_indices, strict=True) as stream,
    ):
        list(stream)


def test_missing_frames_open_unless_strict(tmp_path: Path) -> None:
    write_video(tmp_path, 4)
    (tmp_path / "d.002.exr").unlink()
    (tmp_path / "d.003.exr").unlink()
    line = "video.depth: there is no file d.002.exr (and 1 more frames)"
    assert video_notices(Scene.open(tmp_path).source) == [f"{line}; the one before it stays"]
    with pytest.raises(SceneError) as error:
        Scene.open(tmp_path, strict=True)
    assert str(error.value).endswith(line)
    with pytest.raises(FormatError, match="no such file"):
        Scene.open(tmp_path).frame(2)


def test_check_tells_each_run_and_calls_the_scene_usable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from iprt import cli

    write_video(tmp_path, 6)
    for index in (2, 3):
        cut_off(tmp_path / f"d.{index:03}.exr")
    (tmp_path / "c.005.exr").unlink()
    assert cli.main(["scene", "check", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "warning: frames 2 to 3: d.002.exr: " in out
    assert "warning: frame 5: c.005.exr: no such file" in out
    assert "usable, but see the warnings; 6 frames" in out
