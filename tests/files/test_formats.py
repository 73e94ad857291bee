"""Radiance HDR, TIFF, WebP, AVIF and NumPy files: exact values, and one line for faults."""

from __future__ import annotations

import io
import struct
import sys
from pathlib import Path

import numpy as np
import pillow_heif
import pytest
from PIL import Image, features

from iprt.errors import FormatError
from iprt.files.images import decode_srgb, picture_size, read_color, read_depth, read_header
from tests.files.writing import exif, stored_as, write_hdr, write_tiff

RNG = np.random.default_rng(5)


def refusal(path: Path, read: object = read_color) -> str:
    with pytest.raises(FormatError) as error:
        read(path)  # type: ignore[operator]
    text = str(error.value)
    assert "\n" not in text
    assert text.startswith(str(path))
    return text


@pytest.mark.parametrize("runs", [True, False])
def test_hdr_is_linear(runs: bool, tmp_path: Path) -> None:
    rgbe = RNG.integers(1, 256, (12, 24, 4), dtype=np.uint8)
    rgbe[..., 3] = RNG.integers(110, 150, (12, 24))
    rgbe[3:5] = rgbe[3, 4]
    rgbe[7, 7] = 0
    write_hdr(tmp_path / "c.hdr", rgbe, runs=runs)
    expected = rgbe[..., :3] * 2.0 ** (rgbe[..., 3:].astype(float) - 136)
    color = read_color(tmp_path / "c.hdr")
    assert color.dtype == np.float32
    assert np.array_equal(color, np.where(rgbe[..., 3:] > 0, expected, 0).astype(np.float32))
    header = read_header(tmp_path / "c.hdr")
    assert (header.width, header.height, header.has_end) == (24, 12, False)


def test_hdr_that_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "c.hdr"
    rgbe = RNG.integers(100, 140, (12, 24, 4), dtype=np.uint8)
    write_hdr(path, rgbe, order="+Y 12 +X 24")
    assert "do not begin top left" in refusal(path)
    write_hdr(path, rgbe, order="-Y 12 +X 99999")
    assert "99999 x 12 pixels" in refusal(path)
    write_hdr(path, rgbe)
    assert "in colors" in refusal(path, read_depth)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "cut off or damaged" in refusal(path)
    path.write_bytes(whole.replace(b"rle_rgbe", b"rle_xyze"))
    assert "CIE XYZ" in refusal(path)
    path.write_bytes(b"#?RADIANCE\n")
    assert "no size" in refusal(path)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("channels", [3, 4])
def test_tiff_of_16_bits_and_floats(
    channels: int, order: str, packed: bool, tmp_path: Path
) -> None:
    path = tmp_path / "c.tif"
    shorts = RNG.integers(0, 65536, (6, 12, channels), dtype=np.uint16)
    write_tiff(path, shorts, packed=packed, order=order)
    assert np.array_equal(read_color(path), decode_srgb(shorts[..., :3]))
    assert read_header(path).has_end
    floats = (RNG.random((6, 12, channels)) * 9 - 1).astype(np.float32)
    write_tiff(path, floats, packed=packed, order=order)
    assert np.array_equal(read_color(path), floats[..., :3])
    assert not read_header(path).has_end


@pytest.mark.parametrize("compression", ["raw", "tiff_lzw", "tiff_adobe_deflate"])
def test_tiff_of_8_bits_and_of_depth(compression: str, tmp_path: Path) -> None:
    path = tmp_path / "c.tif"
    bytes_ = RNG.integers(0, 256, (6, 12, 3), dtype=np.uint8)
    Image.fromarray(bytes_).save(path, compression=compression)
    assert np.array_equal(read_color(path), decode_srgb(bytes_))
    floats = RNG.random((6, 12)).astype(np.float32) * 30
    Image.fromarray(floats).save(path, compression=compression)
    depth, bits = read_depth(path)
    assert bits == 0
    assert np.array_equal(depth, floats)
    shorts = RNG.integers(0, 65536, (6, 12), dtype=np.uint16)
    Image.fromarray(shorts).save(path, compression=compression)
    depth, bits = read_depth(path)
    assert bits == 16
    assert np.array_equal(depth, shorts.astype(np.float32))


def test_tiff_of_32_bit_integers_is_depth(tmp_path: Path) -> None:
    longs = RNG.integers(0, 2**32, (6, 12), dtype=np.uint32)
    write_tiff(tmp_path / "d.tif", longs)
    depth, bits = read_depth(tmp_path / "d.tif")
    assert bits == 32
    assert np.array_equal(depth, longs.astype(np.float32))
    assert "read as depth only" in refusal(tmp_path / "d.tif")


def test_tiff_that_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "c.tif"
    for pixels, what in (
        (np.ones((4, 8, 3), np.float16), "16-bit floats in 3 channels"),
        (np.ones((4, 8, 3), np.float64), "64-bit floats"),
        (np.ones((4, 8), np.int16), "signed integers"),
        (np.ones((4, 8, 3), np.uint32), "32-bit integers in 3 channels"),
    ):
        write_tiff(path, pixels)
        assert what in refusal(path)
    write_tiff(path, np.ones((4, 8, 4), np.uint16), photometric=5)
    assert "neither RGB nor grey" in refusal(path)
    write_tiff(path, RNG.random((4, 8, 3)).astype(np.float32))
    assert "in colors" in refusal(path, read_depth)
    whole = path.read_bytes()
    for length in (3, 9, 60, len(whole) - 40):
        path.write_bytes(whole[:length])
        refusal(path)
    write_tiff(path, RNG.integers(0, 65536, (64, 128, 3), dtype=np.uint16), packed=True)
    whole = path.read_bytes()
    path.write_bytes(whole[:3000] + bytes(50) + whole[3050:])
    assert "damaged" in refusal(path)


@pytest.mark.parametrize("suffix", ["webp", "avif"])
def test_webp_and_avif(suffix: str, tmp_path: Path) -> None:
    if not features.check(suffix):
        pytest.skip(f"Pillow has no {suffix}")
    path = tmp_path / f"c.{suffix}"
    flat = np.full((16, 32, 3), (40, 120, 200), np.uint8)
    Image.fromarray(flat).save(path, quality=100)
    assert np.allclose(read_color(path), decode_srgb(flat), atol=0.02)
    assert "in colors" in refusal(path, read_depth)
    grey = np.full((16, 32, 3), 120, np.uint8)
    Image.fromarray(grey).save(path, quality=100)
    depth, bits = read_depth(path)
    assert bits == 8
    assert np.allclose(depth, 120, atol=2)
    Image.fromarray(flat).save(path, quality=100)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    refusal(path)


def test_avif_of_pq_is_refused(tmp_path: Path) -> None:
    if not features.check("avif"):
        pytest.skip("Pillow has no AVIF")
    path = tmp_path / "c.avif"
    Image.new("RGB", (32, 16)).save(path)
    data = path.read_bytes()
    at = data.index(b"colrnclx") + 8
    for transfer, name in ((16, "PQ"), (18, "HLG")):
        path.write_bytes(data[: at + 2] + struct.pack(">H", transfer) + data[at + 4 :])
        assert f"AVIF of {name} is not read" in refusal(path)


@pytest.mark.parametrize("brand", [b"heic", b"mif1", b"hevc"])
def test_heic_is_refused_with_a_way_out(
    brand: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    path = tmp_path / "IMG 1.HEIC"
    path.write_bytes(b"\0\0\0\x18ftyp" + brand + b"\0" * 40)
    for read in (read_color, read_depth, read_header):
        said = refusal(path, read)
        assert "heif-convert 'IMG 1.HEIC' 'IMG 1.png'" in said
        assert "iprt[heic]" in said


@pytest.mark.parametrize("orientation", range(1, 9))
def test_heic_is_upright(orientation: int, tmp_path: Path) -> None:
    path, blocks = tmp_path / "c.heic", RNG.integers(0, 256, (4, 8, 3), dtype=np.uint8)
    seen = blocks.repeat(8, 0).repeat(8, 1)
    stored = pillow_heif.from_pillow(Image.fromarray(stored_as(seen, orientation)))
    tags = exif(orientation).tobytes()
    stored.save(path, quality=-1, chroma=444, matrix_coefficients=0, exif=tags)
    assert np.allclose(read_color(path), decode_srgb(seen), atol=0.02)
    assert picture_size(path) == (64, 32)
    data = path.read_bytes()
    at = data.index(b"colrnclx") + 10
    path.write_bytes(data[:at] + struct.pack(">H", 16) + data[at + 2 :])
    assert "HEIC of PQ is not read" in refusal(path)
    path.write_bytes(data[: len(data) // 2])
    refusal(path)


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f2", "<f8", "u1", "<u2", ">i4"])
def test_npy_of_any_numbers(dtype: str, tmp_path: Path) -> None:
    values = (RNG.random((6, 12)) * 100).astype(dtype)
    expected = 0 if "f" in dtype else 8 * np.dtype(dtype).itemsize
    layouts = (values, np.asfortranarray(values), values[..., None], values[None])
    for stored in layouts:
        np.save(tmp_path / "d.npy", stored)
        np.savez(tmp_path / "d.npz", anything=stored)
        np.savez_compressed(tmp_path / "e.npz", color=np.ones((6, 12, 3)), depth=stored)
        for name in ("d.npy", "d.npz", "e.npz"):
            depth, bits = read_depth(tmp_path / name)
            assert bits == expected
            assert depth.dtype == np.float32
            assert depth.flags.c_contiguous
            assert np.array_equal(depth, values.astype(np.float32))


def test_numpy_files_that_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "d.npy"
    for stored, what in (
        (np.ones((4, 8, 3)), "holds 4 x 8 x 3 float64"),
        (np.ones(8), "holds 8 float64"),
        (np.ones((4, 8), complex), "complex128"),
        (np.array([["a"]]), "<U1"),
        (np.array([[{}]], object), "object"),
    ):
        with path.open("wb") as file:
            np.save(file, stored, allow_pickle=True)
        assert what in refusal(path, read_depth)
    assert "read as depth only" in refusal(path)
    buffer = io.BytesIO()
    np.save(buffer, np.ones((40, 80)))
    for length in (6, 50, 2000):
        path.write_bytes(buffer.getvalue()[:length])
        refusal(path, read_depth)
    path.write_bytes(buffer.getvalue().replace(b"(40, 80)", b"(40000000000, 80)"[:8]))
    refusal(path, read_depth)
    np.savez(tmp_path / "d.npz", a=np.ones((4, 8)), b=np.ones((4, 8)))
    assert "it has a, b" in refusal(tmp_path / "d.npz", read_depth)
    whole = (tmp_path / "d.npz").read_bytes()
    (tmp_path / "d.npz").write_bytes(whole[:-30])
    assert "damaged" in refusal(tmp_path / "d.npz", read_depth)


def test_a_header_that_claims_too_much_is_refused_before_memory_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "d.npy"
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000, 200000), }\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)
    assert "claims 200000 x 100000 pixels" in refusal(path, read_depth)
