"""Gain maps of Ultra HDR: light by the formula of its specification."""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.files.images import NO_GAIN_MAP, decode_srgb, read_color, read_header
from tests.files.writing import XMP, exif

SDR, MAP = 180, 150
OF_MAP = {
    "Version": "1.0",
    "GainMapMin": "-0.5",
    "GainMapMax": "3.0",
    "Gamma": "1.4",
    "OffsetSDR": "0.02",
    "OffsetHDR": "0.01",
    "HDRCapacityMin": "0",
    "HDRCapacityMax": "3.0",
}
PRIMARY = XMP.format('hdrgm:Version="1.0"')


def jpeg(pixels: Image.Image, xmp: str, **options: object) -> bytes:
    file = BytesIO()
    pixels.save(file, "JPEG", quality=100, subsampling=0, xmp=xmp.encode(), **options)
    return file.getvalue()


def with_pictures(primary: bytes, *others: bytes) -> bytes:
    """Return a file of several pictures, with CIPA DC-007's index in the first one's APP2."""
    body_length = 8 + 2 + 3 * 12 + 4 + 16 * (1 + len(others))
    segment = 2 + 2 + 4 + body_length
    at = 2
    first_length = len(primary) + segment
    base = at + 8  # offsets count from the byte order of the index
    entries = struct.pack("<IIIHH", 0x030000, first_length, 0, 0, 0)
    place = first_length
    for other in others:
        entries += struct.pack("<IIIHH", 0, len(other), place - base, 0, 0)
        place += len(other)
    index = b"II*\0" + struct.pack("<IH", 8, 3)
    index += struct.pack("<HHI4s", 0xB000, 7, 4, b"0100")
    index += struct.pack("<HHII", 0xB001, 4, 1, 1 + len(others))
    index += struct.pack("<HHII", 0xB002, 7, len(entries), 8 + 2 + 36 + 4)
    index += b"\0" * 4 + entries
    assert len(index) == body_length
    app2 = b"\xff\xe2" + struct.pack(">H", 2 + 4 + len(index)) + b"MPF\0" + index
    return primary[:at] + app2 + primary[at:] + b"".join(others)


def attributes(values: dict[str, str]) -> str:
    return XMP.format(" ".join(f'hdrgm:{key}="{value}"' for key, value in values.items()))


def grey(value: int, size: tuple[int, int] = (32, 16)) -> Image.Image:
    return Image.new("RGB", size, (value, value, value))


def by_formula(sdr: float, stored: float) -> float:
    log_recovery = (stored / 255) ** (1 / 1.4)
    log_boost = -0.5 * (1 - log_recovery) + 3.0 * log_recovery
    return float((sdr + 0.02) * 2**log_boost - 0.01)


WHITE_180 = float(decode_srgb(np.array([[SDR]], np.uint8))[0, 0])


def test_light_is_that_of_the_formula(tmp_path: Path) -> None:
    path = tmp_path / "c.jpg"
    small = Image.new("L", (8, 4), MAP)
    path.write_bytes(with_pictures(jpeg(grey(SDR), PRIMARY), jpeg(small, attributes(OF_MAP))))
    assert np.allclose(read_color(path), by_formula(WHITE_180, MAP), rtol=1e-5)
    header = read_header(path)
    assert not header.has_end
    assert not header.unread
    # Some programs write the numbers with the first picture, and twice.
    own = attributes(OF_MAP)
    path.write_bytes(with_pictures(jpeg(grey(SDR), own), jpeg(small, "")))
    assert np.allclose(read_color(path), by_formula(WHITE_180, MAP), rtol=1e-5)


def test_channels_have_numbers_of_their_own(tmp_path: Path) -> None:
    values = OF_MAP | {"OffsetSDR": "0", "OffsetHDR": "0", "Gamma": "1", "GainMapMin": "0"}
    del values["GainMapMax"]
    items = "".join(f"<rdf:li>{value}</rdf:li>" for value in (1, 2, 3))
    listed = f"<hdrgm:GainMapMax><rdf:Seq>{items}</rdf:Seq></hdrgm:GainMapMax>"
    xmp = attributes(values).replace("/></rdf:RDF>", f">{listed}</rdf:Description></rdf:RDF>")
    path = tmp_path / "c.jpg"
    path.write_bytes(with_pictures(jpeg(grey(SDR), PRIMARY), jpeg(grey(255), xmp)))
    assert np.allclose(read_color(path)[0, 0], WHITE_180 * np.array([2, 4, 8]), rtol=1e-5)


def test_a_smaller_map_is_interpolated_and_turned_with_its_picture(tmp_path: Path) -> None:
    """Gains of 2^x from left to right, halfway between the map's texels where it has none."""
    values = OF_MAP | {"OffsetSDR": "0", "OffsetHDR": "0", "Gamma": "1", "GainMapMin": "0"}
    ramp = np.repeat(np.linspace(0, 255, 8).round().astype(np.uint8)[None], 4, 0)
    # A JPEG of 100 keeps such a ramp within a code.
    stored = jpeg(Image.fromarray(ramp), attributes(values))
    path = tmp_path / "c.jpg"
    primary = jpeg(grey(SDR), PRIMARY, exif=exif(3))
    path.write_bytes(with_pictures(primary, stored))
    log_gain = np.log2(read_color(path)[:, ::-1] / WHITE_180)
    at = np.clip((np.arange(32) + 0.5) / 4 - 0.5, 0, 7)
    assert np.allclose(log_gain, 3.0 * (at / 7)[None, :, None], atol=0.03)


@pytest.mark.parametrize(
    "xmp",
    [
        XMP.format('HDRGainMap:HDRGainMapVersion="65536"'),
        attributes(OF_MAP | {"BaseRenditionIsHDR": "True"}),
        attributes(OF_MAP | {"GainMapMax": "nan"}),
        attributes(OF_MAP | {"GainMapMax": "400"}),
        attributes(OF_MAP | {"Gamma": "0"}),
        PRIMARY,
    ],
)
def test_a_gain_map_that_is_not_read_is_said(xmp: str, tmp_path: Path) -> None:
    path = tmp_path / "c.jpg"
    path.write_bytes(with_pictures(jpeg(grey(SDR), xmp), jpeg(grey(MAP), "")))
    assert np.allclose(read_color(path), WHITE_180, rtol=1e-5)
    header = read_header(path)
    assert header.has_end
    assert header.unread == NO_GAIN_MAP


def test_a_picture_without_one_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "c.jpg").write_bytes(jpeg(grey(SDR), XMP.format("")))
    assert read_header(tmp_path / "c.jpg").unread == ""
    two = with_pictures(jpeg(grey(SDR), ""), jpeg(grey(MAP), ""))
    (tmp_path / "c.jpg").write_bytes(two)
    assert read_header(tmp_path / "c.jpg").unread == ""
    assert np.allclose(read_color(tmp_path / "c.jpg"), WHITE_180, rtol=1e-5)


def test_a_damaged_gain_map_is_one_line(tmp_path: Path) -> None:
    from iprt.errors import FormatError

    path = tmp_path / "c.jpg"
    whole = with_pictures(jpeg(grey(SDR), PRIMARY), jpeg(grey(MAP), attributes(OF_MAP)))
    path.write_bytes(whole[:-300])
    with pytest.raises(FormatError, match="gain map"):
        read_color(path)
