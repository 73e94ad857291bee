"""Spatial audio metadata, which tells players that a film's sound is ambisonic.

Google's "Spatial Audio RFC" (github.com/google/spatial-media, docs/): the box `SA3D` in the sample
entry of the sound. FFmpeg does not write it, so it is copied from the source's file.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.untrusted import open_file
from iprt.output.boxes import box, boxes_in, child, handler_of, top_boxes

KIND = b"SA3D"
MAX_INDEX_BYTES = 2**28
"""Largest file index that is searched; hours of video have some 2**24 bytes."""
_FIELDS = {0: 28, 1: 44, 2: 64}
"""Bytes before the boxes in a sound sample entry, by version (QuickTime has more than MP4)."""


def track_box(path: Path, number: int) -> bytes:
    """Return the box `SA3D` of a sound track, with its header.

    Parameters
    ----------
    path : Path
        Video file of any kind.
    number : int
        Index among its sound tracks, from 0.

    Returns
    -------
    bytes
        Empty if the file has no such box.
    """
    with suppress(FormatError, IndexError, StopIteration, struct.error):
        tracks = [track for track in _tracks(path) if handler_of(track) == b"soun"]
        table = tracks[number]
        for kind in (b"mdia", b"minf", b"stbl", b"stsd"):
            table = child(table, kind)
        entry = next(boxes_in(table, 8))
        (version,) = struct.unpack_from(">H", table, entry.body + 8)
        found = child(table[entry.body + _FIELDS[min(version, 2)] : entry.end], KIND)
        return box(KIND, found) if found else b""
    return b""


def _tracks(path: Path) -> list[bytes]:
    """Return the contents of the tracks of an MP4 or QuickTime file."""
    with open_file(path) as file:
        index = next((each for each in top_boxes(file) if each.kind == b"moov"), None)
        if index is None or index.end - index.body > MAX_INDEX_BYTES:
            return []
        file.seek(index.body)
        data = file.read(index.end - index.body)
    return [data[each.body : each.end] for each in boxes_in(data) if each.kind == b"trak"]
