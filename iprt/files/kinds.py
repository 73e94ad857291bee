"""Recognition of picture files by their first bytes and by their names."""

from __future__ import annotations

import re
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.exr_header import MAGIC as EXR_MAGIC
from iprt.files.safe_reading import open_file

_SIGNATURES = {
    EXR_MAGIC: "exr",
    b"\x89PNG": "png",
    b"\xff\xd8\xff": "jpeg",
    b"Pf": "pfm",
    b"PF": "pfm",
    b"#?": "hdr",
    b"II*\x00": "tiff",
    b"MM\x00*": "tiff",
    b"II+\x00": "tiff",
    b"MM\x00+": "tiff",
    b"\x93NUMPY": "npy",
    b"PK\x03\x04": "npz",
}
_BRANDS = {b"avif": "avif", b"avis": "avif"} | dict.fromkeys(
    (b"heic", b"heix", b"heim", b"heis", b"hevc", b"mif1", b"msf1"), "heic"
)
"""Brands of pictures in `ftyp` files; other brands are MP4 video."""
_HEADER_BYTES = 2**16
FRAME_PATTERN = re.compile(r"%(0\d)?d")
"""The printf conversions of a frame's number: %d, %04d."""
PICTURE_SUFFIXES = (
    *(".exr", ".png", ".jpg", ".jpeg", ".webp", ".avif", ".heic", ".heif", ".tif", ".tiff"),
    *(".hdr", ".pfm", ".npy", ".npz"),
)
READ = "EXR, PNG, JPEG, WebP, AVIF, HEIC, TIFF, Radiance HDR, PFM or NumPy"


def file_kind(path: Path) -> str:
    """Determine the kind of a file from its first bytes.

    Returns
    -------
    str
        "exr", "png", "jpeg", "webp", "avif", "heic", "tiff", "hdr", "pfm", "npy" or "npz".

    Raises
    ------
    FormatError
        The file is missing, unreadable, empty, or none of these.
    """
    with open_file(path) as file:
        start = file.read(12)
    for signature, kind in _SIGNATURES.items():
        if start.startswith(signature):
            return kind
    if start[:4] == b"RIFF" and start[8:] == b"WEBP":
        return "webp"
    if start[4:8] == b"ftyp" and start[8:] in _BRANDS:
        return _BRANDS[start[8:]]
    what = "empty" if not start else f"not an {READ} file"
    raise FormatError(f"{path}: {what}")


def require_sdr(path: Path, kind: str) -> None:
    """Raise FormatError for AVIF or HEIC in PQ or HLG, which Pillow would read as sRGB."""
    with open_file(path) as file:
        start = file.read(_HEADER_BYTES)
    at = start.find(b"colrnclx")
    transfer = int.from_bytes(start[at + 10 : at + 12], "big") if at >= 0 else 0
    if transfer in (16, 18):
        raise FormatError(
            f"{path}: {kind.upper()} of {'PQ' if transfer == 16 else 'HLG'} is not read; convert "
            "it to EXR, or to a video file, whose highlights are read"
        )
