"""Metadata that tells players that a video is a whole panorama.

Both versions of Google's "Spherical Video RFC" (github.com/google/spatial-media, docs/): boxes in
the format of the pictures, and XML in the track for players that support only that.
"""

from __future__ import annotations

import struct
from pathlib import Path
from uuid import UUID

from iprt import __version__
from iprt.output.boxes import box, full_box

SUFFIXES = (".mp4", ".mov")
"""Suffixes of files that can hold the boxes."""
XML_ID = UUID("ffcc8263-f855-4a93-8814-587a02521fdd").bytes
"""Id of the box that holds the XML."""
MONO = 0
_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_GOOGLE = "http://ns.google.com/videos/1.0/spherical/"


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
