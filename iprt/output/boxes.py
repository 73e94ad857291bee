"""Boxes of MP4 and QuickTime files: moves the index to the front and adds boxes to it.

A file is a sequence of boxes, some of which hold boxes: 32-bit size, four letters, contents
(ISO/IEC 14496-12, section 4). Streaming players need the index, `moov`, before the pictures,
`mdat`. Muxers know its contents only at the end.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from iprt.errors import FormatError

Additions = Mapping[bytes, Mapping[bytes, bytes]]
"""Boxes to append to each `trak`, and to the first entry of each `stsd`, by those names; these by
the kind of track, `vide` or `soun`."""
CONTAINERS = (b"moov", b"trak", b"mdia", b"minf", b"stbl")
"""Boxes that hold only boxes, down to the tables that change here."""
_LARGE = 2**32
_COPY_BYTES = 2**22


@dataclass(frozen=True)
class Box:
    """Box and its position in bytes.

    Attributes
    ----------
    kind : bytes
        Four letters.
    start, body, end : int
        Start of its header, start of its contents, and their end.
    """

    kind: bytes
    start: int
    body: int
    end: int


def box(kind: bytes, *contents: bytes) -> bytes:
    """Return a box with these contents."""
    data = b"".join(contents)
    return struct.pack(">I4s", 8 + len(data), kind) + data


def full_box(kind: bytes, *contents: bytes) -> bytes:
    """Return a box whose contents follow a version and flags, all 0."""
    return box(kind, bytes(4), *contents)


def boxes_in(data: bytes, start: int = 0, end: int | None = None) -> Iterator[Box]:
    """Yield the boxes in `data[start:end]`, one level deep.

    Raises
    ------
    FormatError
        They do not fill it.
    """
    end = len(data) if end is None else end
    while start < end:
        found = _header(data[start : start + 16], start, end)
        yield found
        start = found.end


def _header(data: bytes, start: int, end: int) -> Box:
    try:
        size, kind = struct.unpack_from(">I4s", data)
        body = start + 8
        if size == 1:  # 64-bit size
            (size,) = struct.unpack_from(">Q", data, 8)
            body = start + 16
        elif size == 0:
            size = end - start
    except struct.error as error:
        raise FormatError(f"damaged MP4 file at byte {start}") from error
    if start + size > end or size < body - start:
        raise FormatError(f"damaged MP4 file at byte {start}")
    return Box(kind, start, body, start + size)


def top_boxes(file: BinaryIO) -> list[Box]:
    """Return the boxes of a whole file, reading only their headers."""
    end = file.seek(0, 2)
    found: list[Box] = []
    while (start := found[-1].end if found else 0) < end:
        file.seek(start)
        found.append(_header(file.read(16), start, end))
    return found


def index_first(source: Path, target: Path, additions: Additions) -> None:
    """Copy a file with its index last to one with the index after the file type box.

    Raises
    ------
    FormatError
        The source is not such a file.
    OSError
        A file cannot be read or written.
    """
    with source.open("rb") as file:
        found = top_boxes(file)
        kinds = [each.kind for each in found]
        if kinds[0] != b"ftyp" or kinds[-1] != b"moov" or kinds.count(b"moov") > 1:
            raise FormatError(f"{source}: not as muxers write it: {kinds}")
        head, moov = found[0], found[-1]
        file.seek(moov.body)
        index = file.read(moov.end - moov.body)
        added = sum(len(each) for boxes in additions.values() for each in boxes.values())
        grown = 2 * len(index) + index.count(b"trak") * added
        wide = moov.start + grown + 8 >= _LARGE
        moved = len(_changed(b"moov", index, additions, 0, wide))
        with target.open("wb") as out:
            file.seek(0)
            out.write(file.read(head.end))
            out.write(_changed(b"moov", index, additions, moved, wide))
            for each in found[1:-1]:
                file.seek(each.start)
                _copy(file, out, each.end - each.start)


def _copy(source: BinaryIO, target: BinaryIO, size: int) -> None:
    while size > 0:
        data = source.read(min(size, _COPY_BYTES))
        if not data:
            raise FormatError("a file became shorter while it was read")
        target.write(data)
        size -= len(data)


def _changed(
    kind: bytes,
    data: bytes,
    additions: Additions,
    moved: int,
    wide: bool,
    own: Mapping[bytes, bytes] | None = None,
) -> bytes:
    """Return the box `kind` with contents `data`, for samples moved back by `moved` bytes.

    `own` are the additions to the track that contains it.
    """
    if kind == b"trak":
        own = additions.get(handler_of(data))
    own = own or {}
    if kind in CONTAINERS:
        inner = (
            _changed(each.kind, data[each.body : each.end], additions, moved, wide, own)
            for each in boxes_in(data)
        )
        return box(kind, *inner, own.get(kind, b""))
    if kind == b"stsd":
        first, *others = boxes_in(data, 8)
        entry = box(first.kind, data[first.body : first.end], own.get(kind, b""))
        return box(kind, data[:8], entry, *(data[each.start : each.end] for each in others))
    if kind in (b"stco", b"co64"):
        offsets = np.frombuffer(data, ">u4" if kind == b"stco" else ">u8", offset=8)
        wide = wide or kind == b"co64"
        table = (offsets.astype(np.uint64) + np.uint64(moved)).astype(">u8" if wide else ">u4")
        return box(b"co64" if wide else b"stco", data[:8], table.tobytes())
    return box(kind, data)


def child(data: bytes, kind: bytes) -> bytes:
    """Return the contents of the first box of this kind in `data`, one level deep; empty: none.

    Raises
    ------
    FormatError
        As in `boxes_in`.
    """
    found = (data[each.body : each.end] for each in boxes_in(data) if each.kind == kind)
    return next(found, b"")


def handler_of(track: bytes) -> bytes:
    """Return the kind of a track: `vide`, `soun` and others."""
    return child(child(track, b"mdia"), b"hdlr")[8:12]
