"""Metadata that tells players of whole panoramas and of ambisonic sound.

Google's "Spherical Video RFC", in both versions, and "Spatial Audio RFC"
(github.com/google/spatial-media, docs/). A panorama has boxes in the format of the pictures, and
XML in the track for players that support only that. Ambisonic sound has the box `SA3D` in its
sample entry. FFmpeg does not write it, so it is copied from the source's file.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from pathlib import Path
from uuid import UUID

from iprt import __version__
from iprt.errors import FormatError
from iprt.files.safe_reading import open_file
from iprt.output.boxes import box, boxes_in, child, full_box, handler_of, top_boxes

SUFFIXES = (".mp4", ".mov")
"""Suffixes of files that can hold the boxes."""
XML_ID = UUID("ffcc8263-f855-4a93-8814-587a02521fdd").bytes
"""Id of the box that holds the XML."""
MONO = 0
_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_GOOGLE = "http://ns.google.com/videos/1.0/spherical/"
KIND = b"SA3D"
MAX_INDEX_BYTES = 2**28
"""Largest file index that is searched; hours of video have some 2**24 bytes."""
_FIELDS = {0: 28, 1: 44, 2: 64}
"""Bytes before the boxes in a sound sample entry, by version (QuickTime has more than MP4)."""


def is_spherical(path: Path) -> bool:
    """Return whether files with that suffix can hold the metadata."""
    return path.suffix.lower() in SUFFIXES


def equirect_boxes() -> dict[bytes, bytes]:
    """Return the boxes of a monoscopic equirect video: additions for `index_first`."""
    stereo = full_box(b"st3d", bytes([MONO]))
    return {b"stsd": stereo + _projection(), b"trak": box(b"uuid", XML_ID, _xml().encode())}


def _projection() -> bytes:
    """Return the projection box: the picture's centre straight ahead, the whole sphere covered."""
    maker = full_box(b"svhd", f"iprt {__version__}".encode() + b"\0")
    pose = full_box(b"prhd", struct.pack(">3i", 0, 0, 0))
    bounds = full_box(b"equi", struct.pack(">4I", 0, 0, 0, 0))
    return box(b"sv3d", maker, box(b"proj", pose, bounds))


def _xml() -> str:
    facts = {
        "Spherical": "true",
        "Stitched": "true",
        "StitchingSoftware": f"iprt {__version__}",
        "ProjectionType": "equirectangular",
        "StereoMode": "mono",
    }
    inner = "".join(f"<GSpherical:{key}>{value}</GSpherical:{key}>" for key, value in facts.items())
    return (
        f'<?xml version="1.0"?><rdf:SphericalVideo xmlns:rdf="{_RDF}" '
        f'xmlns:GSpherical="{_GOOGLE}">{inner}</rdf:SphericalVideo>'
    )


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
