"""Numbered pictures: frames of the same render are kept, and others refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt.errors import FormatError
from iprt.geometry.camera import View
from iprt.output.frames import PictureSequence, is_pattern, is_video, numbered, read_metadata
from iprt.output.metadata import difference, picture_metadata
from iprt.output.picture import write_picture
from iprt.renderer import RenderedFrame
from iprt.settings.model import Settings

PICTURE = RenderedFrame(np.full((4, 6, 3), 0.5, np.float32), {})


def metadata(index: int = 0, **changed: Any) -> dict[str, str]:
    given: dict[str, Any] = {
        "scene": "room",
        "view": View(6, 4, yaw_deg=2.0 * index),
        "objects": ("cube",),
        "settings": Settings().model_dump(mode="json"),
        "seed": 0,
        "frames": 4,
        "device": "",
    }
    return {**picture_metadata(**{**given, **changed}), "iprt:frame": str(index)}


def sequence(folder: Path, name: str = "%02d.png") -> PictureSequence:
    return PictureSequence(folder / name, metadata, 1.0)


def write(folder: Path, index: int, name: str = "%02d.png") -> Path:
    """Write a frame, and return its file."""
    told = {**metadata(index), "iprt:device": "a device"}
    sequence(folder, name).write(index, PICTURE, told)
    return numbered(folder / name, index)


@pytest.mark.parametrize("name", ["a%02d.png", "%d.exr"])
def test_what_is_there_is_found(name: str, tmp_path: Path) -> None:
    files = {write(tmp_path, index, name) for index in (3, 7)}
    assert set(tmp_path.iterdir()) == files
    target = sequence(tmp_path, name)
    assert [index for index in range(9) if target.has(index)] == [3, 7]
    told = read_metadata(numbered(tmp_path / name, 7))
    assert told == {**metadata(7), "iprt:device": "a device"}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"seed": 7}, "seed was 0 then and is 7 now"),
        ({"scene": "hall"}, 'scene was "room" then and is "hall" now'),
        ({"frames": 8}, "--accumulate was 4 then and is 8 now"),
        ({"view": View(6, 4, pitch_deg=5.0)}, "view.pitch_deg was 0.0 then and is 5.0 now"),
        ({"objects": None}, 'view.objects was ["cube"] then and is null now'),
        ({"settings": {"trace": {"rays": 8}}}, "settings.trace.rays was 1 then and is 8 now"),
    ],
)
def test_pictures_made_otherwise_are_not_mixed_in(
    changed: dict[str, Any], message: str, tmp_path: Path
) -> None:
    write(tmp_path, 0)
    with pytest.raises(FormatError) as caught:
        PictureSequence(tmp_path / "%02d.png", lambda i: metadata(i, **changed), 1.0).has(0)
    assert str(caught.value) == (
        f"{tmp_path}/00.png: is a frame of another render: {message}; delete all its frames, or "
        "name another output"
    )


def test_devices_may_differ() -> None:
    assert difference(metadata(), metadata(device="another")) is None
    assert difference({**metadata(), "dpi": "72"}, metadata()) is None, "not ours"


@pytest.mark.parametrize("name", ["%02d.png", "%02d.exr"])
@pytest.mark.parametrize("kept", [0.0, 0.5, 0.99])
def test_what_is_not_whole_is_named(kept: float, name: str, tmp_path: Path) -> None:
    path = write(tmp_path, 1, name)
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(FormatError, match=f"{path.name}: is damaged or not by iprt"):
        sequence(tmp_path, name).has(1)


@pytest.mark.parametrize("name", ["%02d.png", "%02d.exr"])
def test_pictures_of_others_are_not_overwritten(name: str, tmp_path: Path) -> None:
    write_picture(numbered(tmp_path / name, 2), PICTURE.color, metadata={"Software": "other"})
    with pytest.raises(FormatError, match="not by iprt; delete it, or name another output"):
        sequence(tmp_path, name).has(2)


def test_what_a_killed_render_left_is_removed(tmp_path: Path) -> None:
    left = tmp_path / f".{'0a' * 16}.tmp"
    left.write_bytes(b"half")
    (tmp_path / ".mine.tmp").write_bytes(b"mine")
    sequence(tmp_path).clean()
    assert [path.name for path in tmp_path.iterdir()] == [".mine.tmp"]


@pytest.mark.parametrize(
    ("name", "pattern", "video"),
    [
        ("%d.png", True, True),
        ("a.%04d.exr", True, True),
        ("a.png", False, False),
        ("50%.png", False, False),
        ("a.MP4", False, True),
        ("a.mkv", False, True),
    ],
)
def test_what_names_mean(name: str, pattern: bool, video: bool) -> None:
    assert (is_pattern(Path("%d") / name), is_video(Path(name))) == (pattern, video)


def test_one_number_in_a_name() -> None:
    assert numbered(Path("o/%03d.png"), 12) == Path("o/012.png")
    with pytest.raises(FormatError, match=r"expected one %d or %04d and no other %"):
        numbered(Path("%d-%d.png"), 1)
