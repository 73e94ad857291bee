"""`iprt scene new` of EXR files with many layers, as 3D programs write them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt import cli
from iprt.scene.scene import Scene
from tests.scene.files import box_room, write_channels, write_rgb

Planes = dict[str, NDArray[Any]]
RNG = np.random.default_rng(2)
DEPTH, NORMAL = (picture.astype(np.float32) for picture in box_room(64, 32))
COLOR = RNG.random((32, 64, 3)).astype(np.float32)
GREY = (COLOR @ np.array([0.2126, 0.7152, 0.0722])).astype(np.float32)


def triple(layer: str, values: NDArray[Any], letters: str = "RGB") -> Planes:
    return {f"{layer}__{letter}": values[..., i] for i, letter in enumerate(letters)}


PASSES: Planes = (
    triple("V__AO", np.repeat(GREY[..., None], 3, axis=-1))
    | triple("V__Combined", COLOR)
    | {"V__Depth__Z": DEPTH, "V__Mist__Z": GREY}
)
NORMALS = triple("V__Normal", NORMAL, "XYZ")
Z_UP = triple("V__Normal", NORMAL[..., [0, 2, 1]] * np.float32([1, -1, 1]), "XYZ")
TWO = triple("left", COLOR) | triple("right", COLOR[:, ::-1]) | {"Z": DEPTH, "WorldDepth": DEPTH}
ONE_DEPTH = ["--color", "two.exr", "--depth-layer", "Z"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that commands run in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def new(*words: str) -> int:
    return cli.main(["scene", "new", "own", *words])


def video() -> dict[str, Any]:
    table: dict[str, Any] = tomllib.loads(Path("own/scene.toml").read_text())["video"]
    return table


@pytest.mark.parametrize("name", ["m.exr", "m.%03d.exr"])
def test_one_file_makes_a_scene(name: str) -> None:
    for number in (4, 5):
        write_channels(Path(name % number if "%" in name else name), **PASSES, **NORMALS)
    assert new("--color", name) == 0
    stored = name.replace("m", "color")
    assert video()["color"] == video()["depth"] == video()["normal"] == stored
    assert "color_layer" not in video()
    raw = Scene.open(Path("own")).raw_frame()
    assert np.array_equal(raw.color, COLOR)
    assert np.array_equal(raw.depth, DEPTH)
    assert raw.normal is not None
    assert np.array_equal(raw.normal, NORMAL)
    assert len(list(Path("own").glob("*.exr"))) == (2 if "%" in name else 1)


def test_normals_in_axes_of_another_program_are_left_out(
    caplog: pytest.LogCaptureFixture,
) -> None:
    write_channels(Path("m.exr"), **PASSES, **Z_UP)
    assert new("--color", "m.exr") == 0
    assert "normal" not in video()
    (record,) = caplog.records
    assert "m.exr: normals differ from the surfaces" in record.getMessage()


def test_flags_choose_and_stay_in_the_manifest() -> None:
    write_channels(Path("m.exr"), **TWO, far__Depth__V=2 * DEPTH)
    assert new("--color", "m.exr", "--color-layer", "right", "--depth-layer", "far.Depth") == 0
    assert video()["color_layer"] == "right"
    assert video()["depth_layer"] == "far.Depth"
    raw = Scene.open(Path("own")).raw_frame()
    assert np.array_equal(raw.color, COLOR[:, ::-1])
    assert np.array_equal(raw.depth, 2 * DEPTH)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (ONE_DEPTH, "be the picture: left, right; name one: --color-layer NAME"),
        (ONE_DEPTH, "(color_layer in scene.toml)"),
        (["--color", "two.exr", "--color-layer", "left"], "could be depth: WorldDepth, Z; name on"),
        (["--color", "m.exr", "--depth-layer", "V.AO"], "m.exr: holds no depth: its values rise"),
        (["--color", "m.exr", "--depth-layer", "V.Mist"], "m.exr: holds no depth: its values ris"),
        (["--color", "m.exr", "--depth-layer", "V.Combined"], "layer V.Combined: a picture in co"),
        (["--color", "m.exr", "--depth-layer", "W"], "--depth-layer W: no such layer; the file ha"),
        (["--color", "m.exr", "--color-layer", "W"], "--color-layer W: no such layer; the file ha"),
        (["--color", "c.exr"], "--depth is missing: c.exr is a picture and holds no depth"),
        (["--color", "foo.exr"], "of its layers, --depth-layer foo names"),
        (["--color", "m.exr", "--depth", "g.exr"], "g.exr: holds no depth: its values rise and f"),
    ],
)
def test_what_cannot_be_is_one_line(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_channels(Path("m.exr"), **PASSES)
    write_channels(Path("two.exr"), **TWO)
    write_rgb(Path("c.exr"), COLOR)
    write_channels(Path("foo.exr"), **triple("", COLOR), foo=DEPTH)
    write_rgb(Path("g.exr"), np.repeat(GREY[..., None], 3, axis=-1))
    assert new(*words) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not Path("own").exists()


def test_layers_are_listed_and_nothing_is_made(capsys: pytest.CaptureFixture[str]) -> None:
    write_channels(Path("m.exr"), **PASSES, **NORMALS)
    write_channels(Path("d.exr"), Z=DEPTH)
    assert new("--color", "m.exr", "--depth", "d.exr", "--list-layers") == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["V.AO", "R,", "G,", "B", "64", "x", "32", "other"] in lines
    assert ["V.Depth.Z", "Z", "64", "x", "32", "depth"] in lines
    assert ["V.Normal", "X,", "Y,", "Z", "64", "x", "32", "normals"] in lines
    assert lines[0] == ["m.exr:"]
    assert ["d.exr:"] in lines
    assert not Path("own").exists()
