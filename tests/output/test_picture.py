"""Pictures come back as written, appear whole or not at all, and are refused in time."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.output.picture import check_output, write_exr, write_picture, write_png

METADATA = {
    "iprt:settings": json.dumps({"method": "iprt", "spp": 2, "note": "Ωµ"}, ensure_ascii=False),
    "iprt:seed": "7",
    "iprt:device": "pocl (Portable Computing Language)",
    "iprt:version": "0.1.0",
}


@pytest.fixture
def color() -> NDArray[np.float32]:
    rng = np.random.default_rng(3)
    return (rng.random((9, 14, 3)) * 5.0).astype(np.float32)


def read_exr(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        pixels = {name: channel.pixels.copy() for name, channel in file.channels().items()}
        return dict(file.header()), pixels


def test_exr_round_trip(tmp_path: Path, color: NDArray[np.float32]) -> None:
    normal, depth = color / 5.0, color[..., 0].copy()
    depth[0, 0] = np.inf
    aovs = {
        "normal": normal,
        "depth": depth,
        "coverage": color[..., 1] > 2.5,
        "irradiance": color * 2.0,
        "level": np.arange(9 * 14).reshape(9, 14),
        "motion": color[..., :2],
    }
    write_picture(tmp_path / "a.exr", color, aovs=aovs, metadata=METADATA)
    header, pixels = read_exr(tmp_path / "a.exr")
    expected = {
        **dict(zip("RGB", np.moveaxis(color, 2, 0), strict=True)),
        **{f"normal.{c}": normal[..., i] for i, c in enumerate("XYZ")},
        **{f"irradiance.{c}": 2.0 * color[..., i] for i, c in enumerate("RGB")},
        **{f"motion.{c}": color[..., i] for i, c in enumerate("XY")},
        "depth.Z": depth,
        "coverage.A": aovs["coverage"].astype(np.float32),
        "level.Y": aovs["level"].astype(np.float32),
    }
    assert set(pixels) == set(expected)
    for name, values in expected.items():
        assert pixels[name].dtype == np.float32, name
        np.testing.assert_array_equal(pixels[name], values, err_msg=name)
    assert {key: header[key] for key in METADATA} == METADATA
    assert json.loads(header["iprt:settings"])["spp"] == 2


def test_half_exr_rounds_and_stays_finite(tmp_path: Path, color: NDArray[np.float32]) -> None:
    color[0, 0] = 1e6
    write_exr(tmp_path / "a.exr", color, half=True)
    _, pixels = read_exr(tmp_path / "a.exr")
    assert pixels["R"].dtype == np.float16
    assert pixels["R"][0, 0] == 65504.0
    np.testing.assert_allclose(pixels["G"][1:], color[1:, :, 1], rtol=2**-11)


def test_exr_layer_of_another_size_is_refused(tmp_path: Path, color: NDArray[np.float32]) -> None:
    with pytest.raises(FormatError, match="layer 'depth' has shape"):
        write_exr(tmp_path / "a.exr", color, aovs={"depth": color[1:, :, 0]})
    assert list(tmp_path.iterdir()) == []


def test_png_round_trip(tmp_path: Path) -> None:
    # Linear values of display codes 0, 128 and 255 at exposure 0.5, and one that clips.
    code_128 = ((128 / 255 + 0.055) / 1.055) ** 2.4
    color = np.array([[[0.0, 2 * code_128, 2.0], [100.0, -1.0, 0.0]]], np.float32)
    write_picture(tmp_path / "a.png", color, exposure=0.5, metadata=METADATA)
    with Image.open(tmp_path / "a.png") as image:
        assert image.mode == "RGB"
        assert dict(image.text) == METADATA  # type: ignore[attr-defined]
        np.testing.assert_array_equal(np.asarray(image), [[[0, 128, 255], [255, 0, 0]]])


def test_png_refuses_what_it_cannot_show(tmp_path: Path, color: NDArray[np.float32]) -> None:
    color[2, 3, 0] = np.nan
    with pytest.raises(FormatError, match=r"a\.png: the image holds 1 pixels"):
        write_png(tmp_path / "a.png", color)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_failure_in_mid_write_leaves_the_old_file(
    name: str, tmp_path: Path, color: NDArray[np.float32], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / name
    write_picture(path, color)
    before = path.read_bytes()

    def fill_disk(target: str | Path) -> None:
        Path(target).write_bytes(b"half a file")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(OpenEXR.File, "write", lambda self, target: fill_disk(target))
    monkeypatch.setattr(Image.Image, "save", lambda self, target, **_: fill_disk(target))
    with pytest.raises(FormatError, match="cannot be written: No space left"):
        write_picture(path, 2.0 * color)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_missing_folders_are_created(tmp_path: Path, color: NDArray[np.float32]) -> None:
    path = tmp_path / "new" / "folder" / "a.exr"
    check_output(path)
    assert not path.parent.exists()  # checking has no effect on the disk
    write_picture(path, color)
    assert [entry.name for entry in path.parent.iterdir()] == ["a.exr"]


def test_written_file_has_the_usual_permissions(tmp_path: Path, color: NDArray[np.float32]) -> None:
    (tmp_path / "plain").write_text("")
    write_picture(tmp_path / "a.png", color)
    assert (tmp_path / "a.png").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("target", ["store/real.png", "nowhere.png", "a.png", "/dev/full"])
def test_links_are_not_replaced(target: str, tmp_path: Path, color: NDArray[np.float32]) -> None:
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "real.png").write_text("mine")
    (tmp_path / "a.png").symlink_to(target)
    for write in (lambda path: write_picture(path, color), check_output):
        with pytest.raises(FormatError, match=r"a\.png: is a symbolic link"):
            write(tmp_path / "a.png")
    assert (tmp_path / "a.png").readlink() == Path(target)
    assert (tmp_path / "store" / "real.png").read_text() == "mine"


def test_pipes_are_not_replaced(tmp_path: Path, color: NDArray[np.float32]) -> None:
    path = tmp_path / "a.png"
    os.mkfifo(path)
    for write in (lambda path: write_picture(path, color), check_output):
        with pytest.raises(FormatError, match=r"a\.png: is a device, pipe or socket"):
            write(path)
    assert path.is_fifo()


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.exr.gz"])
def test_unknown_format_lists_the_supported_ones(name: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"supported: \.exr, \.png"):
        check_output(tmp_path / name)


def test_png_cannot_hold_layers(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"write an \.exr"):
        check_output(tmp_path / "a.png", aovs=("depth",))


def test_output_that_is_a_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.exr").mkdir()
    with pytest.raises(FormatError, match="is a folder"):
        check_output(tmp_path / "a.exr")


def test_output_below_a_file_is_refused(tmp_path: Path, color: NDArray[np.float32]) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FormatError, match="is a file, not a folder"):
        check_output(tmp_path / "file" / "a.exr")
    with pytest.raises(FormatError, match="cannot be written"):
        write_exr(tmp_path / "file" / "a.exr", color)


def test_name_too_long_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="File name too long"):
        check_output(tmp_path / f"{'a' * 300}.exr")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_folder_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(FormatError, match="Permission denied"):
        check_output(tmp_path / "a.exr")
