"""Pictures: exact values, and one clear line for every file that cannot be used."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.errors import FormatError
from iprt.files.images import decode_srgb, read_color, read_depth, read_normal
from tests.scene.files import write_channels, write_png16, write_rgb

RNG = np.random.default_rng(7)
COLOR = RNG.random((16, 32, 3)).astype(np.float32)


def one_line(error: pytest.ExceptionInfo[FormatError], path: Path) -> None:
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_exr_luminance_is_grey(tmp_path: Path) -> None:
    write_channels(tmp_path / "y.exr", Y=COLOR[..., 0])
    assert np.array_equal(read_color(tmp_path / "y.exr"), COLOR[..., [0, 0, 0]])


def test_8_bit_png_is_decoded_from_srgb(tmp_path: Path) -> None:
    coded = np.arange(256, dtype=np.uint8).reshape(8, 32)
    Image.fromarray(np.stack([coded] * 3, axis=-1)).save(tmp_path / "c.png")
    linear = read_color(tmp_path / "c.png")[..., 1].ravel()
    v = np.arange(256) / 255
    expected = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    assert np.allclose(linear, expected, atol=1e-7)
    assert linear[0] == 0.0
    assert linear[-1] == 1.0


def test_jpeg_is_decoded_from_srgb(tmp_path: Path) -> None:
    Image.new("RGB", (16, 8), (128, 128, 128)).save(tmp_path / "c.jpg", quality=95)
    assert np.allclose(read_color(tmp_path / "c.jpg"), 0.2158605, atol=2e-3)


def test_palette_and_alpha_are_colors(tmp_path: Path) -> None:
    rgba = Image.new("RGBA", (4, 2), (255, 0, 0, 10))
    rgba.save(tmp_path / "a.png")
    rgba.convert("RGB").convert("P").save(tmp_path / "p.png")
    for name in ("a.png", "p.png"):
        assert np.allclose(read_color(tmp_path / name), [1, 0, 0])


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("size", [(7, 13), (1, 1), (1, 9), (9, 1), (6, 4)])
def test_16_bit_png_keeps_16_bits(tmp_path: Path, channels: int, size: tuple[int, int]) -> None:
    pixels = RNG.integers(0, 65536, (*size, channels), dtype=np.uint16)
    path = tmp_path / "c.png"
    write_png16(path, pixels)
    expected = pixels[..., [0, 0, 0]] if channels < 3 else pixels[..., :3]
    assert np.array_equal(read_color(path), decode_srgb(expected))
    if channels == 1:
        assert np.array_equal(read_depth(path)[0], pixels[..., 0].astype(np.float32))


def pictures(folder: Path) -> list[Path]:
    write_rgb(folder / "c.exr", COLOR)
    write_png16(folder / "c16.png", (COLOR * 65535).astype(np.uint16))
    image = Image.fromarray((COLOR * 255).astype(np.uint8))
    image.save(folder / "c8.png")
    image.save(folder / "c.jpg")
    return [folder / name for name in ("c.exr", "c16.png", "c8.png", "c.jpg")]


@pytest.mark.parametrize("index", range(4))
def test_cut_off_files_are_errors_at_any_length(tmp_path: Path, index: int) -> None:
    path = pictures(tmp_path)[index]
    data = path.read_bytes()
    lengths = [0, 1, 3, 4, 7, 8, 40, 300, 350, 400]
    lengths += [int(f * len(data)) for f in (0.3, 0.5, 0.8, 0.95)]
    for length in lengths:
        path.write_bytes(data[:length])
        with pytest.raises(FormatError) as error:
            read_color(path)
        one_line(error, path)


def with_window(path: Path, attribute: bytes, window: tuple[int, int, int, int]) -> None:
    data = path.read_bytes()
    at = data.index(attribute + b"\0box2i\0") + len(attribute) + 7 + 4
    path.write_bytes(data[:at] + struct.pack("<4i", *window) + data[at + 16 :])


def test_cropped_exr_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "d.exr"
    write_channels(path, Z=COLOR[..., 0])
    with_window(path, b"displayWindow", (0, 0, 63, 31))
    with pytest.raises(FormatError, match="crop"):
        read_depth(path)


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "LA", "P"])
def test_8_bit_depth_is_exact_in_one_channel_or_three(mode: str, tmp_path: Path) -> None:
    values = np.arange(32, dtype=np.uint8).reshape(4, 8) * 8
    Image.fromarray(values).convert(mode).save(tmp_path / "d.png")
    depth, bits = read_depth(tmp_path / "d.png")
    assert bits == 8
    assert np.array_equal(depth, values)


def test_16_bit_depth_in_three_channels_is_exact(tmp_path: Path) -> None:
    values = np.arange(32, dtype=np.uint16).reshape(4, 8) * 2001
    write_png16(tmp_path / "d.png", np.repeat(values[..., None], 3, axis=-1))
    depth, bits = read_depth(tmp_path / "d.png")
    assert bits == 16
    assert np.array_equal(depth, values)


@pytest.mark.parametrize("name", ["d.png", "p.png", "d.jpg"])
def test_false_colors_are_no_depth(name: str, tmp_path: Path) -> None:
    ramp = np.linspace(0, 255, 256).astype(np.uint8).reshape(8, 32)
    picture = Image.fromarray(np.stack([ramp, 255 - ramp, ramp // 2], axis=-1))
    picture.convert("P" if name == "p.png" else "RGB").save(tmp_path / name)
    with pytest.raises(
        FormatError, match="false colors cannot be read as depth; export depth itself"
    ) as error:
        read_depth(tmp_path / name)
    one_line(error, tmp_path / name)


def test_wrong_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty.exr").touch()
    (tmp_path / "text.exr").write_text("hello")
    (tmp_path / "folder.exr").mkdir()
    for name in ("none.exr", "empty.exr", "text.exr", "folder.exr"):
        for read in (read_color, read_depth, read_normal):
            with pytest.raises(FormatError) as error:
                read(tmp_path / name)
            one_line(error, tmp_path / name)
