"""EXIF orientation: every picture is read as it is meant to be seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, features

from iprt.files.images import decode_srgb, read_color, read_depth, read_header
from tests.files.writing import exif, stored_as, write_png, write_tiff
from tests.scene.files import chunk, write_png16

RNG = np.random.default_rng(11)
SEEN = np.repeat(np.repeat(RNG.integers(0, 256, (4, 6, 3), dtype=np.uint8), 8, 0), 8, 1)
"""Upright picture of blocks, which codecs keep."""
DEPTH = RNG.integers(1, 65536, (12, 24), dtype=np.uint16)
LOSSY = {
    "jpg": {"quality": 100, "subsampling": 0},
    "avif": {"quality": 100, "subsampling": "4:4:4"},
}


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "avif"])
def test_color_is_upright(suffix: str, orientation: int, tmp_path: Path) -> None:
    if suffix == "avif" and not features.check("avif"):
        pytest.skip("Pillow has no AVIF")
    path = tmp_path / f"c.{suffix}"
    options = LOSSY.get(suffix, {"lossless": True} if suffix == "webp" else {})
    stored = Image.fromarray(stored_as(SEEN, orientation))
    stored.save(path, exif=exif(orientation), **options)
    color = read_color(path)
    assert color.shape == SEEN.shape
    assert color.flags.c_contiguous
    assert np.allclose(color, decode_srgb(SEEN), atol=0.06 if suffix in LOSSY else 0.0)
    header = read_header(path)
    assert (header.width, header.height) == (48, 32)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_16_bits_are_upright(orientation: int, tmp_path: Path) -> None:
    seen = RNG.integers(0, 65536, (5, 8, 3), dtype=np.uint16)
    for pixels in (seen, seen[..., 0], np.float32(seen), seen[..., :1].astype("u1").repeat(3, -1)):
        path = tmp_path / "c.tif"
        write_tiff(path, stored_as(pixels, orientation), orientation=orientation)
        linear = pixels if pixels.dtype == np.float32 else decode_srgb(pixels)
        expected = linear if linear.ndim == 3 else np.stack([linear] * 3, -1)
        assert np.array_equal(read_color(path), expected)
        assert (read_header(path).width, read_header(path).height) == (8, 5)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_depth_is_upright_by_its_own_tag(orientation: int, tmp_path: Path) -> None:
    floats = np.where(DEPTH > 60000, np.nan, DEPTH / 7).astype(np.float32)
    bytes_ = (DEPTH >> 8).astype(np.uint8)
    for seen in (DEPTH, bytes_, floats):
        for channels in (1, 3):
            stored = stored_as(seen, orientation)
            stored = stored if channels == 1 else np.repeat(stored[..., None], 3, -1)
            write_tiff(tmp_path / "d.tif", stored, orientation=orientation)
            names = ["d.tif"]
            if seen is bytes_ or (seen is DEPTH and channels == 1):  # what Pillow writes
                write_png(tmp_path / "d.png", stored, exif=exif(orientation))
                names.append("d.png")
            for name in names:
                depth, bits = read_depth(tmp_path / name)
                assert bits == (0 if seen is floats else 8 * seen.dtype.itemsize)
                assert depth.flags.c_contiguous
                assert np.array_equal(depth, seen.astype(np.float32), equal_nan=True)


def test_values_that_are_no_orientation_turn_nothing(tmp_path: Path) -> None:
    for value in (0, 9, 77):
        Image.fromarray(SEEN).save(tmp_path / "c.png", exif=exif(value))
        assert np.array_equal(read_color(tmp_path / "c.png"), decode_srgb(SEEN))


def test_damaged_exif_turns_nothing(tmp_path: Path) -> None:
    path = tmp_path / "c.webp"
    Image.fromarray(SEEN).save(path, exif=exif(3), lossless=True)
    whole = path.read_bytes()
    at = whole.index(exif(3).tobytes().removeprefix(b"Exif\0\0"))
    for byte in range(at, at + 10):
        path.write_bytes(whole[:byte] + b"\x80" + whole[byte + 1 :])
        color = read_color(path)
        assert any(np.array_equal(color, decode_srgb(s)) for s in (SEEN, SEEN[::-1, ::-1]))
        read_header(path)


def test_16_bit_png_with_exif_keeps_16_bits_and_is_upright(tmp_path: Path) -> None:
    pixels = RNG.integers(0, 65536, (4, 8, 3), dtype=np.uint16)
    path = tmp_path / "c.png"
    write_png16(path, stored_as(pixels, 3))
    data = path.read_bytes()
    tag = exif(3).tobytes().removeprefix(b"Exif\0\0")
    at = data.index(b"IDAT") - 4
    path.write_bytes(data[:at] + chunk(b"eXIf", tag) + data[at:])
    assert np.array_equal(read_color(path), decode_srgb(pixels))
