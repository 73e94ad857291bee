"""MP4 boxes: the index before the pictures, and every offset where its picture lies."""

from __future__ import annotations

import struct
from pathlib import Path
from unittest import mock

import pytest

from iprt.errors import FormatError
from iprt.output import boxes
from iprt.output.boxes import Box, box, boxes_in, full_box, index_first, top_boxes

ENTRY_FIELDS = 78
"""Bytes of a picture format (`avc1`, `hvc1`) before the boxes in it."""
PICTURES = (b"first picture", b"second", b"third")


def table(kind: bytes, offsets: list[int]) -> bytes:
    letter = "I" if kind == b"stco" else "Q"
    return full_box(kind, struct.pack(f">I{len(offsets)}{letter}", len(offsets), *offsets))


def movie(kind: bytes = b"stco") -> bytes:
    """As muxers write it: type, free space, pictures, and then where these are.

    A track of sound, whose samples lie among the pictures, follows the one of pictures.
    """
    head = box(b"ftyp", b"isom") + box(b"free")
    start = len(head) + 8
    offsets = [start + sum(map(len, PICTURES[:number])) for number in range(3)]
    tracks = [
        track(handler, box(entry, bytes(ENTRY_FIELDS), box(b"avcC", b"how")), table(kind, offsets))
        for handler, entry in ((b"vide", b"avc1"), (b"soun", b"mp4a"))
    ]
    return head + box(b"mdat", *PICTURES) + box(b"moov", full_box(b"mvhd", b"times"), *tracks)


def track(handler: bytes, entry: bytes, offsets: bytes) -> bytes:
    stsd = full_box(b"stsd", struct.pack(">I", 1), entry)
    said = full_box(b"hdlr", bytes(4) + handler + bytes(13))
    return box(b"trak", box(b"mdia", said, box(b"minf", box(b"stbl", stsd, offsets))))


def at(data: bytes, *path: bytes) -> tuple[Box, bytes]:
    """The box at a path from the top, and its contents; `soun` is the second `trak`."""
    start, end = 0, len(data)
    for step in path:
        kind = b"trak" if step == b"soun" else step
        found = [each for each in boxes_in(data, start, end) if each.kind == kind][step == b"soun"]
        skip = {b"stsd": 8, b"avc1": ENTRY_FIELDS, b"mp4a": ENTRY_FIELDS}.get(kind, 0)
        start, end = found.body + skip, found.end
    return found, data[found.body : found.end]


TABLES = (b"moov", b"trak", b"mdia", b"minf", b"stbl")


SOUND = (b"moov", b"soun", *TABLES[2:])


def offsets_in(data: bytes, kind: bytes, tables: tuple[bytes, ...] = TABLES) -> list[int]:
    _, contents = at(data, *tables, kind)
    letter = "I" if kind == b"stco" else "Q"
    (count,) = struct.unpack_from(">I", contents, 4)
    return list(struct.unpack_from(f">{count}{letter}", contents, 8))


@pytest.mark.parametrize("kind", [b"stco", b"co64"])
def test_offsets_follow_their_pictures(kind: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(movie(kind))
    pictures = {b"stsd": box(b"test", b"in the entry"), b"trak": box(b"uuid", b"in the track")}
    additions = {b"vide": pictures, b"soun": {b"stsd": box(b"SA3D", b"of the sound")}}
    index_first(tmp_path / "a.mp4", tmp_path / "b.mp4", additions)
    data = (tmp_path / "b.mp4").read_bytes()
    with (tmp_path / "b.mp4").open("rb") as file:
        kinds = [each.kind for each in top_boxes(file)]
    assert kinds == [b"ftyp", b"moov", b"free", b"mdat"]
    for tables in (TABLES, SOUND):
        for offset, picture in zip(offsets_in(data, kind, tables), PICTURES, strict=True):
            assert data[offset : offset + len(picture)] == picture
    assert at(data, *SOUND, b"stsd", b"mp4a", b"SA3D")[1] == b"of the sound"
    for name, there in ((b"test", 1), (b"uuid", 1), (b"SA3D", 1)):
        assert data.count(name) == there, "in its own track only"
    assert at(data, *TABLES, b"stsd", b"avc1", b"avcC")[1] == b"how"
    assert at(data, *TABLES, b"stsd", b"avc1", b"test")[1] == b"in the entry"
    assert at(data, b"moov", b"trak", b"uuid")[1] == b"in the track"
    assert at(data, b"moov", b"mvhd")[1] == bytes(4) + b"times"


def test_offsets_beyond_32_bits_get_64(tmp_path: Path) -> None:
    """The file is so large only once its index comes first."""
    (tmp_path / "a.mp4").write_bytes(movie())
    with mock.patch.object(boxes, "_LARGE", len(movie()) - 1):
        index_first(tmp_path / "a.mp4", tmp_path / "b.mp4", {})
    data = (tmp_path / "b.mp4").read_bytes()
    for offset, picture in zip(offsets_in(data, b"co64"), PICTURES, strict=True):
        assert data[offset : offset + len(picture)] == picture


def test_sizes_of_64_bits_and_to_the_end(tmp_path: Path) -> None:
    large = struct.pack(">I4sQ", 1, b"mdat", 16 + 3) + b"abc"
    (tmp_path / "a").write_bytes(box(b"ftyp") + large + struct.pack(">I4s", 0, b"moov") + b"rest")
    with (tmp_path / "a").open("rb") as file:
        found = top_boxes(file)
    assert [(each.kind, each.end - each.body) for each in found] == [
        (b"ftyp", 0),
        (b"mdat", 3),
        (b"moov", 4),
    ]


@pytest.mark.parametrize(
    "data", [b"1234", box(b"moov", b"x")[:-1], struct.pack(">I4s", 7, b"moov")]
)
def test_damaged_files_are_one_line(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(box(b"ftyp") + data)
    with (tmp_path / "a").open("rb") as file, pytest.raises(FormatError, match="at byte 8"):
        top_boxes(file)


def test_other_orders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(box(b"ftyp") + box(b"moov") + box(b"mdat"))
    with pytest.raises(FormatError, match="not as muxers write it"):
        index_first(tmp_path / "a", tmp_path / "b", {})
