"""Pictures from elsewhere are scored as our own are; and what every result says of its making."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt import cli
from iprt.measure import metrics, protocol
from iprt.measure.protocol import provenance, scene_hash
from iprt.output.exr import write_exr
from iprt.scene.scene import Scene
from tests.clips import write_clip
from tests.measure.tiny import write_tiny
from tests.scene.files import write_rgb

PAGE = Path(__file__).parents[2] / "docs" / "protocol.md"


@pytest.fixture
def room(tmp_path: Path) -> Path:
    folder = write_tiny(tmp_path / "room", "near", "again")
    write_exr(folder / "truth.exr", np.random.default_rng(3).random((36, 48, 3), np.float32))
    return folder


@pytest.fixture
def compared(capsys: pytest.CaptureFixture[str]) -> Callable[..., list[dict[str, Any]]]:
    """The results of `iprt compare --json`."""

    def run(*words: object) -> list[dict[str, Any]]:
        capsys.readouterr()
        assert cli.main(["compare", *map(str, words), "--json"]) == 0
        results: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["results"]
        return results

    return run


@pytest.mark.thorough
def test_our_own_picture_has_the_scores_of_our_own(
    room: Path, tmp_path: Path, compared: Callable[..., list[dict[str, Any]]]
) -> None:
    """Beside it in one table, over either background; the truth itself is perfect."""
    mine = tmp_path / "mine"
    mine.mkdir()
    shutil.copy(room / "truth.exr", mine / "again.exr")
    device = ["--device", "pocl"]
    words = ["render", room, "--view", "near", "--accumulate", 2, "-o", mine / "near.exr", *device]
    assert cli.main([*map(str, words)]) == 0
    words = ["--pictures", mine, "--method", "iprt", "--accumulate", 2, *device]
    given, perfect, ours, _ = compared(room, *words)
    assert (given.pop("method"), given.pop("ms"), ours.pop("method")) == ("mine", {}, "iprt")
    assert ours.pop("ms")
    assert (given.pop("bytes"), ours.pop("bytes") > 0) == (0, True)
    assert given["view"] == ours["view"] == "near"
    for name, value in given["scores"].items():
        # Files hold half floats.
        same = value if value is None else pytest.approx(value, abs=2e-3)
        assert ours["scores"][name] == same, name
    assert (perfect["view"], perfect["scores"]["ssim"]) == ("again", 1.0)
    (alone,) = compared(room, "--pictures", mine, "--view", "near", "--background", "truth")
    assert (alone["background"], alone["scores"]) == ("truth", given["scores"])


def test_frames_of_a_video_are_named_by_their_numbers(
    tmp_path: Path, compared: Callable[..., list[dict[str, Any]]]
) -> None:
    folder = write_clip(tmp_path / "clip", 4, first=2)
    manifest = folder / "scene.toml"
    manifest.write_text(manifest.read_text() + 'truth = "truth.%d.exr"\n')
    (tmp_path / "mine").mkdir()
    for index, level in ((3, 0.2), (5, 0.4)):
        write_rgb(folder / f"truth.{index}.exr", np.full((16, 32, 3), 0.4, np.float32))
        write_rgb(tmp_path / f"mine/ahead.000{index}.exr", np.full((16, 32, 3), level, np.float32))
    dark, right = compared(folder, "--pictures", tmp_path / "mine")
    assert [dark["view"], right["view"]] == ["ahead 3", "ahead 5"]
    assert dark["scores"]["rmse"] == pytest.approx(0.2, rel=1e-3)
    assert (right["scores"]["rmse"], right["scores"]["ssim"]) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "spoil", "message"),
    [
        ("near.exr", lambda p: p.unlink(), "near.exr: there is no such picture"),
        ("naer.exr", lambda p: p.touch(), "naer.exr: is no view of box with a truth"),
        (
            "near.exr",
            lambda p: write_rgb(p, np.zeros((18, 24, 3), "f4")),
            "24x18 pixels, but the truth",
        ),
        (
            "near.exr",
            lambda p: write_rgb(p, np.full((36, 48, 3), np.nan, "f4")),
            "holds NaN or infinite",
        ),
        ("near.exr", lambda p: p.write_bytes(b"\x89PNG"), "is no EXR picture"),
        ("near.exr", lambda p: p.write_bytes(b"v/1\x01cut off"), "near.exr: "),
    ],
)
def test_faults_are_named(
    room: Path,
    tmp_path: Path,
    name: str,
    spoil: Callable[[Path], object],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    for view in ("near", "again"):
        shutil.copy(room / "truth.exr", mine / f"{view}.exr")
    spoil(mine / name)
    assert cli.main(["compare", str(room), "--pictures", str(mine)]) == 2
    line = capsys.readouterr().err
    assert message in line
    assert line.count("\n") == 1


def test_a_scene_has_the_hash_of_its_contents(room: Path, tmp_path: Path) -> None:
    """Of what its manifest says, however written; a copy has it too, under any name."""
    copy = shutil.copytree(room, tmp_path / "copy")
    manifest = copy / "scene.toml"
    text = manifest.read_text()
    other = text.replace('name = "box"', 'name = "copy"', 1)
    default = other.replace("pitch_deg", "yaw_deg = 0.0\npitch_deg", 1)
    manifest.write_text(f"# A comment.\n{default}")
    own = scene_hash(Scene.open(room))
    assert scene_hash(Scene.open(copy)) == own
    changed = {own}
    for name in ("color.exr", "truth.exr", "cube.obj"):
        before = (copy / name).read_bytes()
        (copy / name).write_bytes(before + b"\n")
        changed.add(scene_hash(Scene.open(copy)))
        (copy / name).write_bytes(before)
    manifest.write_text(text.replace("pitch_deg = -35", "pitch_deg = -34", 1))
    changed.add(scene_hash(Scene.open(copy)))
    assert len(changed) == 5


def test_the_protocol_is_what_its_page_says(room: Path) -> None:
    """The page's version, and the numbers of its metrics."""
    page = PAGE.read_text(encoding="utf-8")
    assert page.startswith(f"# The protocol of comparisons, version {protocol.VERSION}\n")
    told = (f"window of {metrics.SSIM_WINDOW} pixels", f"σ {metrics.SSIM_SIGMA}")
    assert all(text in page for text in (*told, f"{metrics.FLIP_PPD:g} pixels per degree"))
    found = provenance(Scene.open(room))
    assert (found["protocol"], found["scene"]) == (protocol.VERSION, Scene.open(room).name)
