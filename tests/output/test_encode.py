"""Video files: every picture at its time, in the colors it had, said to be what it is."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.output import encode
from iprt.output.boxes import boxes_in
from iprt.output.display import display
from iprt.output.encode import (
    CODECS,
    FORMATS,
    CodecName,
    encode_piece,
    frame_rate,
    join_pieces,
    mux_in_order,
    planes,
    read_comment,
    require_codec,
    require_even,
)
from iprt.output.spatial_media import XML_ID, equirect_boxes
from tests.output.test_boxes import TABLES, at
from tests.output.test_ycbcr import decoded

WIDTH, HEIGHT = 64, 32
NTSC = Fraction(24000, 1001)


def color(number: int) -> NDArray[np.float32]:
    """A smooth picture whose brightness tells its number."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    picture = np.stack([x / WIDTH, y / HEIGHT, 1.0 - x / WIDTH], axis=-1)
    return (0.2 + 0.4 * picture + 0.02 * number).astype(np.float32)


def written(
    folder: Path,
    suffix: str,
    codec: CodecName = "h264",
    lengths: Sequence[int] = (5, 5, 2),
    additions: dict[bytes, bytes] | None = None,
) -> Path:
    pieces = []
    for length in lengths:
        first = sum(lengths[: len(pieces)])
        path = folder / f"{first}.mp4"
        pictures = (planes(color(first + number), 1.0, codec) for number in range(length))
        encode_piece(path, pictures, codec=codec, rate=NTSC)
        pieces.append((first, path))
    path = folder / f"a{suffix}"
    join_pieces(path, pieces, rate=NTSC, comment="made here", additions=additions)
    return path


def read(path: Path, bits: int) -> tuple[list[float], list[NDArray[np.float64]], dict[str, Any]]:
    """Times in seconds, pictures as displayed, and what the file says of them."""
    times, pictures = [], []
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        context = stream.codec_context
        for frame in container.decode(stream):
            times.append(float(frame.time))
            pictures.append(decoded(frame.to_ndarray(), bits))
        said = {
            "rate": stream.average_rate,
            "tags": tuple(
                int(tag)
                for tag in (
                    context.color_primaries,
                    context.color_trc,
                    context.colorspace,
                    context.color_range,
                )
            ),
            "pixels": context.pix_fmt,
            "codec": context.name,
            "tag": context.codec_tag,
            "comment": container.metadata.get("comment", container.metadata.get("COMMENT")),
        }
    return times, pictures, said


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("suffix", FORMATS)
def test_pictures_come_back_in_order_at_their_times(
    suffix: str, codec: CodecName, tmp_path: Path
) -> None:
    path = written(tmp_path, suffix, codec)
    bits = CODECS[codec].bits
    times, pictures, said = read(path, bits)
    assert np.allclose(times, np.arange(12) / float(NTSC), atol=6e-4), "Matroska counts in ms"
    for number, picture in enumerate(pictures):
        off = np.abs(picture - display(color(number))) * 255.0
        assert off.mean() < 2.0, number
    assert said["rate"] == NTSC
    # BT.709 primaries, sRGB transfer, BT.709 matrix, limited range (ISO/IEC 23091-2).
    assert said["tags"] == (1, 13, 1, 1)
    assert said["pixels"] == CODECS[codec].pixels
    assert said["codec"] == codec
    assert said["comment"] == read_comment(path) == "made here"
    data = path.read_bytes()
    if suffix != ".mkv":
        assert data.index(b"moov") < data.index(b"mdat"), "players that stream start at once"
        entry = next(boxes_in(at(data, *TABLES, b"stsd")[1], 8))
        assert entry.kind == {"h264": b"avc1", "hevc": b"hvc1"}[codec]
    assert {each.suffix for each in tmp_path.iterdir()} <= {".mp4", suffix}


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("length", [1, 2, 3])
def test_the_shortest_pieces(length: int, codec: CodecName, tmp_path: Path) -> None:
    """Encoders that look at several pictures at once differ here, and some guess."""
    for attempt in range(8):
        (tmp_path / f"{attempt}").mkdir()
        path = written(tmp_path / f"{attempt}", ".mp4", codec, lengths=(4, length, length))
        times, _, said = read(path, CODECS[codec].bits)
        assert np.allclose(times, np.arange(4 + 2 * length) / float(NTSC))
        assert said["rate"] == NTSC


def test_decoding_times_of_the_encoder_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=24)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        packets = []
        for number in range(6):
            picture = planes(color(number), 1.0, "h264")
            frame = av.VideoFrame.from_ndarray(picture, format="yuv420p")
            frame.pts, frame.time_base = number, Fraction(1, 24)
            packets += stream.encode(frame)
        packets += stream.encode()
        assert [packet.pts for packet in packets] != sorted(packet.pts for packet in packets)
        for packet in packets:
            packet.dts = 2**50
        mux_in_order(container, packets)
    with av.open(str(path)) as container:
        read = [packet for packet in container.demux(video=0) if packet.size]
    step = Fraction(1, 24) / read[0].time_base
    assert sorted(packet.pts / step for packet in read) == list(range(6))
    assert {after.dts - before.dts for before, after in pairwise(read)} == {step}
    assert all(packet.dts <= packet.pts for packet in read)


def test_joining_changes_no_picture(tmp_path: Path) -> None:
    _, whole, _ = read(written(tmp_path, ".mp4"), 8)
    for first, length in ((0, 5), (5, 5), (10, 2)):
        _, piece, _ = read(tmp_path / f"{first}.mp4", 8)
        assert np.array_equal(piece, whole[first : first + length])


def test_every_piece_can_be_sought(tmp_path: Path) -> None:
    with av.open(str(written(tmp_path, ".mp4"))) as container:
        stream = container.streams.video[0]
        keys = [p.pts for p in container.demux(stream) if p.is_keyframe and p.pts is not None]
        found = [round(float(key * stream.time_base * NTSC)) for key in keys]
    assert found == [0, 5, 10]


@pytest.mark.parametrize("suffix", [".mp4", ".mov"])
def test_panoramas_say_so(suffix: str, tmp_path: Path) -> None:
    """FFmpeg reads them as spherical, and so do we, box by box, as the two RFCs have them."""
    path = written(tmp_path, suffix, lengths=(2,), additions=equirect_boxes())
    with av.open(str(path)) as container:
        frame = next(container.decode(video=0))
        told = {str(data.type): bytes(data) for data in frame.side_data}
    kinds = {name.rpartition(".")[2].lower() for name in told}
    assert {"spherical", "stereo3d"} <= kinds, told
    data = path.read_bytes()
    entry = (*TABLES, b"stsd", b"avc1")
    assert at(data, *entry, b"st3d")[1] == bytes(4) + b"\0", "version, flags, one eye"
    assert at(data, *entry, b"sv3d", b"svhd")[1].startswith(bytes(4) + b"iprt ")
    assert at(data, *entry, b"sv3d", b"svhd")[1].endswith(b"\0")
    pose = at(data, *entry, b"sv3d", b"proj", b"prhd")[1]
    assert struct.unpack(">I3i", pose) == (0, 0, 0, 0)
    bounds = at(data, *entry, b"sv3d", b"proj", b"equi")[1]
    assert struct.unpack(">I4I", bounds) == (0, 0, 0, 0, 0)
    contents = at(data, b"moov", b"trak", b"uuid")[1]
    assert contents[:16] == XML_ID == bytes.fromhex("ffcc8263f8554a938814587a02521fdd")
    root = ElementTree.fromstring(contents[16:].decode())
    facts = {child.tag.rpartition("}")[2]: child.text for child in root}
    assert root.tag.endswith("SphericalVideo")
    assert facts["Spherical"] == facts["Stitched"] == "true"
    assert facts["ProjectionType"] == "equirectangular"


def test_views_do_not_say_that_they_are_panoramas(tmp_path: Path) -> None:
    data = written(tmp_path, ".mp4", lengths=(2,)).read_bytes()
    assert not {b"sv3d", b"st3d", XML_ID} & {
        data[i : i + n] for n in (4, 16) for i in range(len(data))
    }


@pytest.mark.parametrize(
    ("fps", "step", "rate"),
    [
        (30.0, 1, Fraction(30)),
        (24000 / 1001, 1, NTSC),
        (29.97, 1, Fraction(2997, 100)),
        (30.0, 4, Fraction(15, 2)),
        (0.5, 1, Fraction(1, 2)),
    ],
)
def test_rates_are_the_fractions_that_were_meant(fps: float, step: int, rate: Fraction) -> None:
    assert frame_rate(fps, step) == rate


@pytest.mark.parametrize(("fps", "step"), [(1e-12, 1), (1e12, 1), (1.0, 5000)])
def test_rates_that_no_file_can_hold_are_refused(fps: float, step: int) -> None:
    with pytest.raises(FormatError, match=r"video files hold 0\.001 to 1000"):
        frame_rate(fps, step)


def test_odd_sizes_are_refused_with_one_that_would_do() -> None:
    require_even(32, 16)
    with pytest.raises(FormatError, match=r"33 x 17 pixels: .* try --size 32 16"):
        require_even(33, 17)
    with pytest.raises(FormatError, match="--size 2 2"):
        require_even(1, 1)


def test_a_missing_encoder_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    require_codec("h264")
    lacking = encode.Codec("libnone", "yuv420p", 8, {})
    monkeypatch.setattr(encode, "CODECS", {"h264": lacking})
    with pytest.raises(FormatError, match=r"--codec h264: PyAV \S+ has no libnone"):
        require_codec("h264")


def test_pieces_of_another_encoder_are_not_joined(tmp_path: Path) -> None:
    one, other = tmp_path / "1.mp4", tmp_path / "2.mp4"
    encode_piece(one, [planes(color(0), 1.0, "h264")], codec="h264", rate=NTSC)
    small = planes(color(0)[:16], 1.0, "h264")
    encode_piece(other, [small], codec="h264", rate=NTSC)
    with pytest.raises(FormatError, match=r"2\.mp4: is of another encoder than 1\.mp4"):
        join_pieces(tmp_path / "a.mp4", [(0, one), (1, other)], rate=NTSC, comment="")


def test_damaged_pieces_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "1.mp4").write_bytes(b"no video")
    with pytest.raises(FormatError, match=r"a\.mp4: cannot be written: Invalid data") as caught:
        join_pieces(tmp_path / "a.mp4", [(0, tmp_path / "1.mp4")], rate=NTSC, comment="")
    assert "\n" not in str(caught.value)
    assert {each.name for each in tmp_path.iterdir()} == {"1.mp4"}


@pytest.mark.parametrize("content", [None, b"", b"no video"])
def test_what_is_no_video_has_no_comment(content: bytes | None, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "a.mp4").write_bytes(content)
    assert read_comment(tmp_path / "a.mp4") is None


def test_long_comments_are_kept(tmp_path: Path) -> None:
    piece = tmp_path / "1.mp4"
    encode_piece(piece, [planes(color(0), 1.0, "h264")], codec="h264", rate=NTSC)
    text = json.dumps({"settings": "µ" * 10_000}, ensure_ascii=False)
    for suffix in FORMATS:
        join_pieces(tmp_path / f"a{suffix}", [(0, piece)], rate=NTSC, comment=text)
        assert read_comment(tmp_path / f"a{suffix}") == text
