"""Crops, stereo and shapes other than 2:1: every texel shows its own direction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt import cli
from iprt.errors import FormatError
from iprt.files.images import decode_srgb
from iprt.footage.prepare.reading import RawFrame
from iprt.footage.prepare.stages import Preparation
from iprt.scene.scene import Scene
from tests.files.writing import XMP, gpano, write_png, write_tiff
from tests.footage.video.encoding import Track, grey16, plain, write_video
from tests.scene.files import box_room, directions, write_channels, write_png16_grey, write_rgb

WIDTH, HEIGHT = 192, 96
LEFT, TOP, ACROSS, DOWN = 48, 20, 96, 48
"""Crop that is itself twice as wide as high."""


def sight(width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.float32]:
    """Return radiance (height, width, 3) that encodes the direction of each texel of the sphere."""
    return (0.5 + 0.4 * directions(width, height)).astype(np.float32)


def distance(width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.float32]:
    return box_room(width, height)[0].astype(np.float32)


def cropped(plane: NDArray[Any], scale: int = 1) -> NDArray[Any]:
    rows = slice(TOP // scale, (TOP + DOWN) // scale)
    return plane[rows, LEFT // scale : (LEFT + ACROSS) // scale]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_channels(Path("depth.exr"), Z=distance())
    return tmp_path


def made(*words: str) -> RawFrame:
    assert cli.main(["scene", "new", "own", *words]) == 0
    return Scene.open(Path("own")).raw_frame()


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    capsys.readouterr()
    assert cli.main(["scene", "new", "own", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert not Path("own").exists()
    return error


def require_placed(raw: RawFrame, depth: NDArray[np.float32]) -> None:
    """Color and depth lie where the crop is; all else is black and has no surface."""
    color = np.zeros_like(raw.color)
    cropped(color)[:] = cropped(sight())
    there = np.zeros(depth.shape, np.float32)
    cropped(there)[:] = cropped(depth)
    assert np.array_equal(raw.color, color)
    assert np.array_equal(np.maximum(raw.depth, 0.0), there)


def test_a_crop_lies_where_gpano_says(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    xmp = gpano((ACROSS, DOWN), (LEFT, TOP), (WIDTH, HEIGHT), ' GPano:PoseHeadingDegrees="90"')
    write_tiff(Path("c.tif"), cropped(sight()), xmp=xmp)
    write_channels(Path("d.exr"), Z=cropped(distance()))
    raw = made("--color", "c.tif", "--depth", "d.exr")
    require_placed(raw, distance())
    # Half of all directions around, between two latitudes.
    share = 50 * (np.cos(np.pi * TOP / HEIGHT) - np.cos(np.pi * (TOP + DOWN) / HEIGHT)) / 2
    said = capsys.readouterr().out
    assert f"c.tif covers {share:.3g}% of the sphere; the rest is unknown".replace(
        "c.", "color."
    ) in (said)
    frame = Preparation()(raw)
    assert np.isinf(frame.depth[0]).all()
    assert np.allclose(cropped(frame.depth), cropped(distance()))


def test_depth_of_a_crop_may_be_smaller_or_whole(folder: Path) -> None:
    xmp = gpano((ACROSS, DOWN), (LEFT, TOP), (WIDTH, HEIGHT))
    write_tiff(Path("c.tif"), cropped(sight()), xmp=xmp)
    raw = made("--color", "c.tif", "--depth", "depth.exr")
    assert np.array_equal(raw.depth, distance())
    np.save("small.npy", cropped(distance(WIDTH // 2, HEIGHT // 2), 2))
    assert cli.main(["scene", "new", "two", "--color", "c.tif", "--depth", "small.npy"]) == 0
    depth = Scene.open(Path("two")).raw_frame().depth
    inside = cropped(depth)[2:-2, 2:-2]
    assert np.allclose(inside, cropped(distance())[2:-2, 2:-2], rtol=0.1)
    cropped(depth)[:] = 0.0
    assert not (np.isfinite(depth) & (depth > 0)).any()


def test_around_a_crop_is_no_hole_that_is_filled_in(folder: Path) -> None:
    """The surroundings stay unknown whatever value marks holes."""
    xmp = gpano((ACROSS, DOWN), (LEFT, TOP), (WIDTH, HEIGHT))
    write_tiff(Path("c.tif"), cropped(sight()), xmp=xmp)
    millimetres = np.rint(1000 * cropped(distance())).astype(np.uint16)
    hole = slice(20, 24), slice(40, 46)
    millimetres[hole] = 0
    write_png16_grey(Path("d.png"), millimetres)
    words = ["--color", "c.tif", "--depth", "d.png", "--depth-scale", "0.001", "--invalid", "0"]
    frame = Preparation()(made(*words))
    inside = cropped(np.arange(WIDTH * HEIGHT).reshape(HEIGHT, WIDTH))
    outside = np.setdiff1d(np.arange(WIDTH * HEIGHT), inside)
    assert np.isinf(frame.depth.flat[outside]).all()
    assert np.allclose(cropped(frame.depth)[hole], cropped(distance())[hole], rtol=0.1)
    assert not frame.opening.any()


def test_a_crop_that_was_scaled_keeps_its_place(folder: Path) -> None:
    """GPano has the numbers of the original; the picture is 3/4 of its size."""
    full = sight(WIDTH * 3 // 4, HEIGHT * 3 // 4)
    xmp = gpano((ACROSS, DOWN), (LEFT, TOP), (WIDTH, HEIGHT))
    write_tiff(Path("c.tif"), full[15:51, 36:108], xmp=xmp)
    write_channels(Path("d.exr"), Z=distance(WIDTH // 2, HEIGHT // 2))
    raw = made("--color", "c.tif", "--depth", "d.exr")
    expected = np.zeros_like(full)
    expected[15:51, 36:108] = full[15:51, 36:108]
    assert np.array_equal(raw.color, expected)


@pytest.mark.parametrize("form", ["attributes", "elements", "png"])
def test_ways_to_write_gpano(form: str, folder: Path) -> None:
    xmp = gpano((ACROSS, DOWN), (LEFT, TOP), (WIDTH, HEIGHT))
    codes = np.round(cropped(sight()) * 255).astype(np.uint8)
    if form == "png":
        write_png(Path("c.png"), codes, xmp)
    else:
        if form == "elements":
            import re

            elements = re.sub(r'(GPano:\w+)="(\d+)"', r"<\1> \2 </\1>", xmp)
            xmp = elements.replace(' rdf:about="" ', ' rdf:about="">').replace(
                "/></rdf:RDF>", "</rdf:Description></rdf:RDF>"
            )
        write_tiff(Path("c.png"), codes, xmp=xmp)
    raw = made("--color", "c.png", "--depth", "depth.exr")
    expected = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    cropped(expected)[:] = decode_srgb(codes)
    assert np.array_equal(raw.color, expected)


@pytest.mark.parametrize(
    "xmp",
    [
        "",
        XMP.format('GPano:ProjectionType="equirectangular" GPano:PoseHeadingDegrees="77"'),
        gpano((WIDTH, HEIGHT), (0, 0), (WIDTH, HEIGHT)),
        XMP.format('GPano:FullPanoWidthPixels="9" GPano:CroppedAreaLeftPixels="3"'),
    ],
)
def test_whole_panoramas_stay_as_they_are(xmp: str, folder: Path) -> None:
    write_tiff(Path("c.tif"), sight(), xmp=xmp)
    raw = made("--color", "c.tif", "--depth", "depth.exr")
    assert np.array_equal(raw.color, sight())
    assert np.array_equal(raw.depth, distance())


@pytest.mark.parametrize(
    ("xmp", "message"),
    [
        (XMP.format('GPano:ProjectionType="cylindrical"'), 'projection is "cylindrical"'),
        (gpano((96, 48), (100, 0), (192, 96)), "is no part of a panorama"),
        (gpano((96, 48), (-1, 0), (192, 96)), "is no part of a panorama"),
        (gpano((96, 48), (0, 0), (192, 150)), "is no part of a panorama"),
        (gpano((0, 48), (0, 0), (192, 96)), "is no part of a panorama"),
        (gpano((1, 1), (0, 0), (99998, 49999)), "at most 16384 a side"),
    ],
)
def test_gpano_that_makes_no_sense(
    xmp: str, message: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tiff(Path("c.tif"), sight(), xmp=xmp)
    words = ["--color", "c.tif", "--depth", "depth.exr"]
    assert message in refused(capsys, *words)
    # An option overrides the file.
    assert np.array_equal(made(*words, "--fit", "stretch").color, sight())


@pytest.mark.parametrize("height", [94, 98, 108, 102])
def test_a_stretched_sphere_is_resampled(height: int, folder: Path) -> None:
    write_rgb(Path("c.exr"), sight(WIDTH, height))
    write_channels(Path("d.exr"), Z=distance(WIDTH, height))
    raw = made("--color", "c.exr", "--depth", "d.exr", "--fit", "stretch")
    assert raw.color.shape == (HEIGHT, WIDTH, 3)
    # Linear interpolation is off by a curve's height over its chord; beyond the last row's middle,
    # next to the poles, that row stays.
    error = np.abs(raw.color - sight())
    assert error[2:-2].max() <= 0.4 * (np.pi / height) ** 2 / 8 + 1e-6
    assert error.max() <= 0.4 * np.pi / height / 2
    # Depth is never mixed, but taken from the nearest row.
    at = np.clip(np.floor((np.arange(HEIGHT) + 0.5) / HEIGHT * height).astype(int), 0, height - 1)
    assert np.array_equal(raw.depth, distance(WIDTH, height)[at])
    assert Scene.open(Path("own")).manifest.video.fit == "stretch"


@pytest.mark.parametrize(("above", "below"), [(1, 1), (6, 6), (0, 1), (4, 5)])
def test_missing_rows_are_unknown(above: int, below: int, folder: Path) -> None:
    rows = slice(above, HEIGHT - below)
    write_rgb(Path("c.exr"), sight()[rows])
    write_channels(Path("d.exr"), Z=distance()[rows])
    raw = made("--color", "c.exr", "--depth", "d.exr", "--fit", "pad")
    for found, whole in ((raw.color, sight()), (np.maximum(raw.depth, 0.0), distance())):
        assert np.array_equal(found[rows], whole[rows])
        assert not found[:above].any()
        assert not found[HEIGHT - below :].any()


@pytest.mark.parametrize("bars", [(6, 6), (1, 1), (12, 11)])
def test_bars_are_cut_off(
    bars: tuple[int, int], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    above = np.zeros((bars[0], WIDTH, 3), np.float32)
    below = np.zeros((bars[1], WIDTH, 3), np.float32)
    write_rgb(Path("c.exr"), np.concatenate([above, sight(), below]))
    depth = np.pad(distance(), (bars, (0, 0)))
    write_channels(Path("d.exr"), Z=depth)
    words = ["--color", "c.exr", "--depth", "d.exr"]
    assert "--fit crop" in refused(capsys, *words)
    raw = made(*words, "--fit", "crop")
    assert np.array_equal(raw.color, sight())
    assert np.array_equal(raw.depth, distance())


def test_whole_depth_and_normals_of_a_fitted_picture(folder: Path) -> None:
    normal = box_room(WIDTH, HEIGHT)[1].astype(np.float32)
    write_rgb(Path("c.exr"), np.pad(sight(), ((6, 6), (0, 0), (0, 0))))
    write_rgb(Path("n.exr"), np.pad(normal, ((6, 6), (0, 0), (0, 0))))
    words = ["--color", "c.exr", "--depth", "depth.exr", "--normal", "n.exr", "--fit", "crop"]
    raw = made(*words)
    assert np.array_equal(raw.depth, distance())
    assert raw.normal is not None
    assert np.array_equal(raw.normal, normal)


@pytest.mark.parametrize(
    ("size", "hint"),
    [
        ((192, 92), "--fit stretch (fit in [video]) where it is all"),
        ((192, 100), "--fit stretch (fit in [video]) where it is all"),
        ((192, 60), "--fit pad (fit in [video])"),
        ((96, 96), "take one by --eye left"),
        ((192, 48), "side by side, take one by --eye left"),
    ],
)
def test_other_shapes_are_refused_with_what_they_may_be(
    size: tuple[int, int], hint: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_rgb(Path("c.exr"), sight(*size))
    error = refused(capsys, "--color", "c.exr", "--depth", "depth.exr")
    assert f"{size[0]} x {size[1]} pixels; an equirect panorama is twice as wide as high" in error
    assert hint in error


@pytest.mark.parametrize("eye", ["left", "right"])
@pytest.mark.parametrize("axis", [0, 1])
def test_an_eye_of_a_stereo_picture(axis: int, eye: str, folder: Path) -> None:
    both = [sight(), sight() ** 2]
    depths = [distance(), distance() * 1.1]
    write_rgb(Path("c.exr"), np.concatenate(both, axis))
    write_channels(Path("d.exr"), Z=np.concatenate(depths, axis))
    raw = made("--color", "c.exr", "--depth", "d.exr", "--eye", eye)
    chosen = int(eye == "right")
    assert np.array_equal(raw.color, both[chosen])
    assert np.array_equal(raw.depth, depths[chosen])
    assert raw.color.flags.c_contiguous
    assert (
        cli.main(["scene", "new", "two", "--color", "c.exr", "--depth", "depth.exr", "--eye", eye])
        == 0
    )
    assert np.array_equal(Scene.open(Path("two")).raw_frame().depth, distance())


def test_an_eye_is_fitted_without_the_other(folder: Path) -> None:
    """Interpolation must not mix in rows of the other eye."""
    for axis, shape in ((0, (192, 100)), (1, (192, 94))):
        one = np.full((shape[1], shape[0], 3), 0.25, np.float32)
        write_rgb(Path("c.exr"), np.concatenate([one, 3 * one], axis))
        for number, eye in enumerate(("left", "right")):
            name = f"own{axis}{number}"
            words = ["--color", "c.exr", "--depth", "depth.exr", "--eye", eye, "--fit", "stretch"]
            assert cli.main(["scene", "new", name, *words]) == 0
            color = Scene.open(Path(name)).raw_frame().color
            assert color.shape == (HEIGHT, WIDTH, 3)
            assert np.allclose(color, (0.25, 0.75)[number])


def test_no_stereo_picture_has_no_eyes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_rgb(Path("c.exr"), sight())
    error = refused(capsys, "--color", "c.exr", "--depth", "depth.exr", "--eye", "left")
    assert "c.exr: 192 x 96 pixels are no two panoramas" in error


def flat(value: int, u: int, v: int, width: int, height: int) -> list[NDArray[np.uint8]]:
    planes = plain(value, width, height)
    return [planes[0], np.full_like(planes[1], u), np.full_like(planes[2], v)]


def stacked(above: list[Any], below: list[Any], axis: int = 0) -> list[NDArray[np.uint8]]:
    return [np.concatenate(pair, axis) for pair in zip(above, below, strict=True)]


def test_videos_of_two_eyes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    left, right = flat(60, 90, 200, 64, 32), flat(180, 160, 100, 64, 32)
    depth = [np.full((32, 64), 2000)]
    write_video(Path("d.mkv"), grey16(depth))
    for axis in (0, 1):
        write_video(Path("c.mkv"), Track("ffv1", "yuv420p", [stacked(left, right, axis)] * 3))
        write_video(Path("one.mkv"), Track("ffv1", "yuv420p", [left] * 3))
        words = ["--depth", "d.mkv", "--depth-scale", "0.001"]
        assert "take one by --eye left" in refused(capsys, "--color", "c.mkv", *words)
        for name, chosen in (("c.mkv", ["--eye", "left"]), ("one.mkv", [])):
            assert (
                cli.main(["scene", "new", f"{axis}{name}", "--color", name, *words, *chosen]) == 0
            )
        eye, one = (Scene.open(Path(f"{axis}{n}")).raw_frame() for n in ("c.mkv", "one.mkv"))
        # Chroma has half the resolution: a row or column next to the other eye takes some of it.
        assert np.array_equal(eye.color[:-1, 1:-1], one.color[:-1, 1:-1])
        assert np.array_equal(eye.depth, one.depth)
    assert "with eye, which takes" in refused(
        capsys, "--color", "c.mkv", "--eye", "left", "--depth-scale", "1"
    )


@pytest.mark.parametrize("codec", ["ffv1", "libx264"])
def test_a_lower_half_in_colors_is_no_depth(
    codec: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ramp = np.tile(np.linspace(60, 200, 64, dtype=np.uint8), (32, 1))
    colored = [ramp, *flat(0, 110, 160, 64, 32)[1:]]
    grey = [ramp, *plain(0, 64, 32)[1:]]
    above = flat(90, 90, 180, 64, 32)
    words = ["--color", "c.mkv", "--depth-range", "1", "9"]
    write_video(Path("c.mkv"), Track(codec, "yuv420p", [stacked(above, colored)] * 3))
    error = refused(capsys, *words)
    assert "lower half of its pictures is in colors, and no depth" in error
    assert "--eye left" in error
    assert "false colors" in error
    write_video(Path("c.mkv"), Track(codec, "yuv420p", [stacked(above, grey)] * 3))
    assert cli.main(["scene", "new", "own", *words]) == 0


def test_a_frame_of_another_size_is_named(folder: Path) -> None:
    for number, height in ((0, 108), (1, 104)):
        write_rgb(Path(f"c.{number}.exr"), sight(WIDTH, height))
    Path("scene.toml").write_text(
        'format = 1\nname = "s"\n[video]\ncolor = "c.%d.exr"\ndepth = "depth.exr"\n'
        'fit = "stretch"\nframes = [0, 1]\n'
    )
    frames = Scene.open(Path(".")).raw_frames
    assert frames.read(0).color.shape == (HEIGHT, WIDTH, 3)
    with pytest.raises(FormatError, match="192 x 104 pixels, but the first frame has 192 x 108"):
        frames.read(1)


def test_integers_below_a_range_of_any_depth_of_bits(folder: Path) -> None:
    """`--depth-range` knows the largest value of each type."""
    write_rgb(Path("c.exr"), sight())
    part = (distance() - 1.0) / 5.0
    write_png16_grey(Path("d.png"), np.rint(part * 65535).astype(np.uint16))
    write_tiff(Path("d.tif"), np.rint(part * 65535).astype(np.uint16))
    np.save("d.npy", np.rint(part * 65535).astype(np.uint16))
    np.save("e.npy", np.rint(part * (2.0**32 - 1)).astype(np.uint32))
    for name in ("d.png", "d.tif", "d.npy", "e.npy"):
        words = ["--color", "c.exr", "--depth", name, "--depth-range", "1", "6"]
        assert cli.main(["scene", "new", f"of {name}", *words]) == 0
        depth = Scene.open(Path(f"of {name}")).raw_frame().depth
        assert np.allclose(depth, distance(), atol=1e-4)
