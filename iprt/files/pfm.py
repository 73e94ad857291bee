"""Portable float map: single-channel pictures, bottom row first, either byte order."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.safe_reading import require_picture_size

_HEADER = re.compile(rb"(P[fF])\s+(\d{1,10})\s+(\d{1,10})\s+([^\s]{1,32})\s")


def read_pfm(path: Path) -> NDArray[np.float32]:
    """Read a grey PFM file as (H, W) float32, top row first.

    The sign of the header's third number gives the byte order (negative: little endian). Its
    magnitude is ignored, as in most programs: the manifest's `depth_scale` is the only unit.

    Raises
    ------
    FormatError
        The header is missing or invalid, there are three channels, or the pixels are cut off.
    """
    with path.open("rb") as file:
        header = _HEADER.match(file.read(128))
        if header is None:
            raise FormatError(f"{path}: not a PFM file (no header Pf, width, height, scale)")
        kind, width, height = header[1], int(header[2]), int(header[3])
        if kind == b"PF":
            raise FormatError(f"{path}: PFM with three channels (PF); depth needs one (Pf)")
        require_picture_size(path, width, height)
        try:
            scale = float(header[4])
        except ValueError:
            scale = math.nan
        if not math.isfinite(scale) or scale == 0.0:
            raise FormatError(f"{path}: the PFM header's scale is not a number other than 0")
        present, expected = os.fstat(file.fileno()).st_size - header.end(), 4 * width * height
        if present < expected:
            raise FormatError(f"{path}: cut off PFM file: {present} of {expected} bytes of pixels")
        file.seek(header.end())
        data = file.read(expected)
    order = "<" if scale < 0.0 else ">"
    return np.frombuffer(data, f"{order}f4").reshape(height, width)[::-1].astype(np.float32)
