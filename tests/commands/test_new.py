"""`iprt scene new`, given what people give it: every mistake is named, nothing is left behind."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt import cli
from iprt.scene.new_scene import pattern_in
from tests.scene.files import box_room, directions, write_channels, write_png16_grey, write_rgb

COLOR, DEPTH, RANGE = ["--color", "pano.png"], ["--depth", "depth.exr"], ["--depth-range", "1", "9"]


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Pictures of a room, good ones and bad ones; the folder that commands run in."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("iprt.scene.real_materials.MIN_HEIGHT", 65)  # gloss is not looked for
    depth, normal = box_room(128, 64)
    rng = np.random.default_rng(3)
    photo = rng.integers(0, 255, (64, 128, 3), np.uint8)
    Image.fromarray(photo).save("pano.png")
    write_rgb(Path("pano.exr"), (photo / 99).astype(np.float32))
    write_channels(Path("depth.exr"), Z=depth.astype(np.float32))
    write_channels(Path("part.exr"), Z=(depth / 10).astype(np.float32))
    write_channels(Path("inverse.exr"), Z=(1 / depth).astype(np.float32))
    write_rgb(Path("depth3.exr"), np.repeat(depth[..., None], 3, axis=-1).astype(np.float32))
    write_png16_grey(Path("mm.png"), np.rint(1000 * depth).astype(np.uint16))
    Image.fromarray((40 * depth).astype(np.uint8)).save("grey8.png")
    write_rgb(Path("normal.exr"), normal.astype(np.float32))
    write_rgb(Path("normal01.exr"), (0.5 + 0.5 * normal).astype(np.float32))
    write_rgb(Path("normal_zxy.exr"), normal[..., [2, 0, 1]].astype(np.float32))
    Path("shots").mkdir()
    for number in (8, 9, 11):
        Image.fromarray(photo).save(f"shots/f_{number:03d}.png")
    Path("steps").mkdir()
    for number in (10, 12, 14):
        Image.fromarray(photo).save(f"steps/s{number}.png")
        write_channels(Path(f"steps/s{number}.exr"), Z=depth.astype(np.float32))
    for number in (1, 2, 90):
        Image.fromarray(photo).save(f"steps/far{number}.png")
    false = np.stack([40 * depth, 200 - 40 * depth, 20 * depth], axis=-1)
    Image.fromarray(false.astype(np.uint8)).save("jet.png")
    part = np.abs(directions(128, 64)).max(axis=-1)
    write_channels(Path("cube.exr"), Z=(depth * part).astype(np.float32))
    holed = depth.copy()
    holed[25:35, 40:60] = 65.535
    write_png16_grey(Path("holed.png"), np.rint(1000 * holed).astype(np.uint16))
    Path("empty").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (COLOR, "--depth is missing: pano.png is a picture and holds no depth"),
        (["--color", "shots", *DEPTH], "is a folder; its numbered pictures are named by a pattern"),
        (["--color", "shots", *DEPTH], "--color shots/f_%03d.png"),
        (["--color", "empty", *DEPTH], "is a folder; name a picture or a video file in it"),
        ([*COLOR, "--depth", "shots"], "--depth shots: is a folder"),
        (["--color", "steps/far%d.png", *DEPTH], "of 90 pictures, far3.png and 86 more missing"),
        ([*COLOR, "--depth", "steps/s%d.exr"], "steps/s0.exr: no such file"),
        (
            ["--color", "steps/s%d.png", "--depth", "shots/f_%03d.png"],
            "shots/f_010.png: no such file",
        ),
        (["--color", "none.png", *DEPTH], "--color none.png: no such file"),
        ([*COLOR, "--depth", "mm.png"], "mm.png: stores integers; give --depth-scale"),
        ([*COLOR, *DEPTH, *RANGE], "depth.exr: stores floats up to 4"),
        ([*COLOR, "--depth", "pano.exr"], "pano.exr: a picture in colors, whose R, G and B"),
        ([*COLOR, "--depth", "pano.png", *RANGE], "pano.png: a picture in colors"),
        ([*COLOR, "--depth", "grey8.png"], "grey8.png: stores integers; give --depth-scale"),
        ([*COLOR, "--depth", "jet.png", *RANGE], "false colors cannot be read as depth; export"),
        ([*COLOR, *DEPTH, "--depth-kind", "z"], "--depth-kind z: z-depth along one axis does n"),
        ([*COLOR, *DEPTH, "--invalid", *map(str, range(17))], "depth_invalid: expected 16 v"),
        ([*COLOR, *DEPTH, "--sky", "7", "--invalid", "7"], "depth_sky: 7 is in depth_invalid too"),
        ([*COLOR, *DEPTH, "--normal", "pano.exr"], "pano.exr: holds no normals"),
        ([*COLOR, *DEPTH, "--normal", "normal01.exr"], "normal01.exr: holds no normals"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(
    words: list[str], message: str, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["scene", "new", "own", *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (files / "own").exists()


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([*COLOR, "--depth", "mm.png", "--depth-scale", "1"], "half of the depth is beyond 1.9"),
        ([*COLOR, "--depth", "mm.png", "--depth-scale", "1e-5"], "is nearer than 1.9 cm"),
        ([*COLOR, "--depth", "inverse.exr"], "depth: seems to be stored as 1 / depth"),
        ([*COLOR, *DEPTH, "--normal", "normal_zxy.exr"], "normals: differ from the surfaces"),
        ([*COLOR, "--depth", "cube.exr"], "depth: seems to be z-depth of a cube's six faces"),
        ([*COLOR, *DEPTH, "--depth-kind", "cube"], "depth: seems to be the distance along each"),
        ([*COLOR, "--depth", "holed.png", "--depth-scale", "0.001"], "65535 stands in 2.44% of"),
        ([*COLOR, "--depth", "grey8.png", "--depth-scale", "0.025"], "has 8 bits: at the median"),
    ],
)
def test_what_is_unlikely_is_said_by_all_verbs(
    words: list[str], said: str, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for verb in (["new", "own", *words], ["check", "own"], ["info", "own"]):
        assert cli.main(["scene", *verb]) == 0
        out = capsys.readouterr().out
        (line,) = [line for line in out.splitlines() if said in line]
        assert "warning: " in line
        assert "own: fine" not in out
    assert cli.main(["scene", "info", "own", "--json"]) == 0
    assert said in json.loads(capsys.readouterr().out)["unlikely"][0]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "words",
    [
        [*COLOR, *DEPTH],
        [*COLOR, "--depth", "depth3.exr", "--normal", "normal.exr"],
        [*COLOR, "--depth", "mm.png", "--depth-scale", "0.001"],
        [*COLOR, "--depth", "part.exr", "--depth-range", "1e-9", "10"],
        [*COLOR, "--depth", "cube.exr", "--depth-kind", "cube"],
        [*COLOR, "--depth", "holed.png", "--depth-scale", "0.001", "--invalid", "65535"],
        [*COLOR, "--depth", "holed.png", "--depth-scale", "0.001", "--sky", "65535", "-1", "nan"],
    ],
)
def test_a_good_scene_tells_how_large_the_place_is(
    words: list[str], files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["scene", "new", "own", *words]) == 0
    out = capsys.readouterr().out
    assert "the camera is 1.30 m above the floor" in out
    assert "warning" not in out
    assert cli.main(["scene", "check", "own"]) == 0
    assert "own: fine" in capsys.readouterr().out
    assert cli.main(["scene", "info", "own"]) == 0
    assert "the camera is 1.30 m above the floor" in capsys.readouterr().out


def test_pictures_in_steps_become_frames_one_after_the_other(
    files: Path, caplog: pytest.LogCaptureFixture
) -> None:
    Path("steps/s14.png").write_bytes(Path("shots/f_009.png").read_bytes())
    pairs = ["--color", "steps/s%d.png", "--depth", "steps/s%d.exr"]
    assert cli.main(["scene", "new", "own", *pairs]) == 0
    assert "frames = [10, 12]" in Path("own/scene.toml").read_text()
    for frame, number in ((10, 10), (11, 12), (12, 14)):
        for key, suffix in (("color", "png"), ("depth", "exr")):
            copy, source = Path(f"own/{key}.{frame}.{suffix}"), Path(f"steps/s{number}.{suffix}")
            assert copy.read_bytes() == source.read_bytes()
    (line,) = [record.message for record in caplog.records if "steps" in record.message]
    assert line == "steps/s%d.png: its numbers from 10 to 14 in steps of 2 become frames 10 to 12"


def test_gaps_are_named_and_bridged(
    files: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    assert cli.main(["scene", "new", "own", "--color", "shots/f_%03d.png", *DEPTH]) == 0
    line = "shots/f_%03d.png: of 4 pictures, f_010.png missing; the one before each gap stays"
    assert [record.message for record in caplog.records] == [line]
    assert "frames = [8, 11]" in Path("own/scene.toml").read_text()
    assert "a scene of 4 frames" in capsys.readouterr().out
    assert sorted(path.name for path in Path("own").glob("color*")) == [
        "color.008.png",
        "color.009.png",
        "color.011.png",
    ]
    assert cli.main(["scene", "check", "own"]) == 0
    assert "there is no file color.010.png; the one before it" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["a.0001.exr", "a.0002.exr", "a.0003.exr", "b.1.exr", "b.2.exr"], "a.%04d.exr"),
        (["9.png", "10.png", "11.png"], "%d.png"),
        (["x_098_l.png", "x_099_l.png", "x_100_l.png"], "x_%03d_l.png"),
        (["IMG2.JPG", "IMG3.JPG"], "IMG%d.JPG"),
        (["pano.png", "depth.png", "a.txt", "1.txt", "2.txt", "one1.png"], None),
    ],
)
def test_patterns_of_numbered_pictures(
    names: list[str], pattern: str | None, tmp_path: Path
) -> None:
    for name in names:
        (tmp_path / name).touch()
    assert pattern_in(tmp_path) == pattern
