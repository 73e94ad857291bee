"""Layers of EXR files: what names mean decides, and what they leave open is one clear error."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.exr import exr_layers, layer_lines
from iprt.files.images import picture_size, read_color, read_depth, read_normal
from tests.scene.files import write_channels, write_rgb

RNG = np.random.default_rng(11)
Plane = NDArray[np.float32]
COLOR, NORMAL, OTHER = RNG.random((3, 16, 32, 3)).astype(np.float32)
DEPTH, WRONG = 5 * RNG.random((2, 16, 32)).astype(np.float32)
GREY = np.repeat(COLOR[..., :1], 3, axis=-1)
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


def triple(prefix: str, values: Plane, letters: str = "RGB") -> dict[str, Plane]:
    return {f"{prefix}{letter}": values[..., i] for i, letter in enumerate(letters)}


def write_parts(path: Path, **parts: dict[str, Plane]) -> None:
    made = []
    for name, channels in parts.items():
        planes = {channel: np.ascontiguousarray(plane) for channel, plane in channels.items()}
        made.append(OpenEXR.Part({"type": OpenEXR.scanlineimage}, planes, name))
    OpenEXR.File(made).write(str(path))


BLENDER = (
    triple("ViewLayer.AO.", OTHER)
    | triple("ViewLayer.Combined.", COLOR)
    | {"ViewLayer.Combined.A": WRONG, "ViewLayer.Mist.Z": WRONG, "ViewLayer.IndexOB.X": WRONG}
    | triple("ViewLayer.CryptoObject00.", OTHER, "rgb")
    | triple("ViewLayer.DiffCol.", OTHER)
    | triple("ViewLayer.Denoising Normal.", OTHER, "XYZ")
    | triple("ViewLayer.Normal.", NORMAL, "XYZ")
    | {"ViewLayer.Denoising Depth.Z": WRONG}
)
WHOLE = {
    "Depth.Z": BLENDER | {"ViewLayer.Depth.Z": DEPTH},
    "Depth.V": BLENDER | {"ViewLayer.Depth.V": DEPTH},
    "leading dots": triple(".", COLOR) | {".Depth.Z": DEPTH} | triple(".Normal.", NORMAL, "XYZ"),
    "grey beauty": triple("beauty.", COLOR) | {"Z": DEPTH} | triple("N.", NORMAL),
    "WorldDepth": triple("", COLOR) | {"WorldDepth": DEPTH} | triple("WorldNormal.", NORMAL, "xyz"),
    "UE": triple("", COLOR)
    | triple("FinalImageMovieRenderQueue_WorldDepth.", np.stack([DEPTH] * 3, -1))
    | triple("normals.", NORMAL, "XYZ"),
    "eyes": triple("", COLOR)
    | triple("right.", OTHER)
    | {"Z": DEPTH, "right.Z": WRONG, "ZBack": WRONG}
    | triple("normal.", NORMAL, "xyz"),
}


@pytest.mark.parametrize("name", WHOLE)
def test_one_file_holds_color_depth_and_normals(name: str, tmp_path: Path) -> None:
    path = tmp_path / "m.exr"
    write_channels(path, **WHOLE[name])
    assert np.array_equal(read_color(path), COLOR)
    assert np.array_equal(read_depth(path)[0], DEPTH)
    assert np.array_equal(read_normal(path), NORMAL)


@pytest.mark.parametrize("prefix", ["", ".", "Depth.", "layer.", "depth_pass."])
def test_equal_channels_are_one_depth(prefix: str, tmp_path: Path) -> None:
    write_channels(tmp_path / "d.exr", **triple(prefix, np.stack([DEPTH] * 3, -1)), A=WRONG)
    assert np.array_equal(read_depth(tmp_path / "d.exr")[0], DEPTH)


@pytest.mark.parametrize("name", ["V", "foo", "a.b.c", ".T", "WorldDepth", "beauty.R"])
def test_the_only_channel_is_depth_by_any_name(name: str, tmp_path: Path) -> None:
    write_channels(tmp_path / "d.exr", **{name: DEPTH})
    assert np.array_equal(read_depth(tmp_path / "d.exr")[0], DEPTH)


@pytest.mark.parametrize(
    ("read", "channels", "message"),
    [
        (read_color, triple("left.", COLOR) | triple("right.", OTHER), "picture: left, right; nam"),
        (read_color, triple("A.Combined.", COLOR) | triple("B.Combined.", COLOR), "A.Combined, B."),
        (read_color, triple("AO.", COLOR) | {"Z": DEPTH}, "no layer is the picture by its name: A"),
        (read_depth, {"Z": DEPTH, "WorldDepth": DEPTH}, "be depth: WorldDepth, Z; name one: --dep"),
        (read_depth, triple("", COLOR) | {"foo": DEPTH}, "be depth: RGB, foo; name one: --depth-l"),
        (read_depth, {"AO.V": DEPTH}, "no layer is depth by its name: AO.V; name one: --depth-lay"),
        (read_depth, triple("Depth.", COLOR), "layer Depth: a picture in colors, whose R, G and"),
        (read_depth, triple("N.", NORMAL, "XYZ"), "no channel of depth; the file has N.X, N.Y, N."),
        (
            read_normal,
            triple("N.", COLOR) | triple("Normal.", OTHER),
            "normals: N, Normal; save on",
        ),
        (read_normal, {"Z": DEPTH}, "no channels R, G, B or X, Y, Z of normals; the file has Z"),
    ],
)
def test_what_names_leave_open_is_one_line(
    read: Callable[[Path], object], channels: dict[str, Plane], message: str, tmp_path: Path
) -> None:
    write_channels(tmp_path / "m.exr", **channels)
    with pytest.raises(FormatError) as error:
        read(tmp_path / "m.exr")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_layer_is_chosen_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "m.exr"
    write_channels(path, **BLENDER, ViewLayer__Depth__Z=DEPTH)
    assert np.array_equal(read_color(path, "ViewLayer.AO"), OTHER)
    assert np.array_equal(read_color(path, "ViewLayer.Mist"), np.stack([WRONG] * 3, -1))
    for name in ("ViewLayer.Denoising Depth.Z", "ViewLayer.Denoising Depth"):
        assert np.array_equal(read_depth(path, name)[0], WRONG)
    with pytest.raises(FormatError, match="--depth-layer Dept: no such layer; the file has View"):
        read_depth(path, "Dept")
    with pytest.raises(FormatError, match=r"layer ViewLayer.AO: a picture in colors"):
        read_depth(path, "ViewLayer.AO")
    assert any("ViewLayer.Depth.Z" in line and "depth" in line for line in layer_lines(path))


def test_several_parts_are_read_at_their_own_sizes(tmp_path: Path) -> None:
    path = tmp_path / "m.exr"
    write_parts(
        path,
        AO=triple("", OTHER),
        rgba=triple("", COLOR) | {"A": WRONG},
        depth={"Z": DEPTH},
        normal=triple("normal.", NORMAL, "XYZ"),
    )
    names = [layer.name for layer in exr_layers(path)]
    assert names == ["AO", "rgba", "rgba.A", "depth.Z", "normal"]
    assert np.array_equal(read_color(path), COLOR)
    assert np.array_equal(read_depth(path)[0], DEPTH)
    assert np.array_equal(read_normal(path), NORMAL)
    assert picture_size(path) == (32, 16)


def test_several_parts_that_are_cut_off_are_errors(tmp_path: Path) -> None:
    path = tmp_path / "m.exr"
    write_parts(path, rgba=triple("", COLOR), depth={"Z": DEPTH})
    data = path.read_bytes()
    for length in [*range(0, 800, 37), len(data) // 2, len(data) - 1]:
        path.write_bytes(data[:length])
        with pytest.raises(FormatError) as error:
            read_depth(path)
        assert "\n" not in str(error.value)
    at = data.index(b"chunkCount\0int\0") + len(b"chunkCount\0int\0") + 4
    path.write_bytes(data[:at] + b"\xff\xff\xff\x7f" + data[at + 4 :])
    with pytest.raises(FormatError, match="cut off or damaged"):
        read_color(path)


@pytest.mark.parametrize("name", ["HTJ2K32", "HTJ2K256", "ZSTD"])
@pytest.mark.parametrize("rows", [16, 300])
def test_newer_compressions_are_read(name: str, rows: int, tmp_path: Path) -> None:
    compression = getattr(OpenEXR, f"{name}_COMPRESSION", None)
    if compression is None:
        pytest.skip("this version of OpenEXR does not have it")
    path, color = tmp_path / "c.exr", RNG.random((rows, 2 * rows, 3)).astype(np.float16)
    header = {"compression": compression, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(color)}).write(str(path))
    assert np.array_equal(read_color(path), color.astype(np.float32))


def write_with(path: Path, chromaticities: tuple[float, ...], color: Plane = COLOR) -> None:
    header = {"type": OpenEXR.scanlineimage, "chromaticities": chromaticities}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(color)}).write(str(path))


@pytest.mark.parametrize(
    ("chromaticities", "matrix"),
    [
        # ITU-R BT.2407-0, section 2.
        (
            REC2020,
            [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]],
        ),
        # As published with OpenColorIO's ACES configuration: Bradford from the ACES white to D65.
        (
            ACESCG,
            [[1.7051, -0.6218, -0.0833], [-0.1303, 1.1408, -0.0105], [-0.0240, -0.1290, 1.1530]],
        ),
    ],
)
def test_other_primaries_become_rec709(
    chromaticities: tuple[float, ...], matrix: list[list[float]], tmp_path: Path
) -> None:
    write_with(tmp_path / "c.exr", chromaticities)
    assert np.allclose(read_color(tmp_path / "c.exr"), COLOR @ np.array(matrix).T, atol=3e-4)
    write_with(tmp_path / "c.exr", chromaticities, np.ones((8, 16, 3), np.float32))
    assert np.allclose(read_color(tmp_path / "c.exr"), 1.0, atol=1e-5)


def test_rec709_is_exact_and_unusable_primaries_are_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_with(tmp_path / "c.exr", (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.329))
    assert np.array_equal(read_color(tmp_path / "c.exr"), COLOR)
    assert not caplog.records
    for number, bad in enumerate([(0.0,) * 8, (0.3,) * 8, (*REC2020[:7], 0.0)]):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name in ("a.exr", "b.exr"):
            write_with(folder / name, bad)
            with caplog.at_level(logging.WARNING, "iprt"):
                assert np.array_equal(read_color(folder / name), COLOR)
        assert len(caplog.records) == number + 1
    assert "a.exr: chromaticities cannot be used" in caplog.text


def test_any_number_of_threads_decodes_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = np.random.default_rng(5).random((300, 20, 3)).astype(np.float32)
    path = tmp_path / "color.exr"
    write_rgb(path, values)
    for count in (1, 4):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        assert np.array_equal(read_color(path), values)
        assert OpenEXR.global_thread_count() == count
