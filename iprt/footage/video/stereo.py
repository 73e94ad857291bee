"""Pictures in which the other eye lies where depth could: below colour."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from iprt.errors import FormatError
from iprt.footage.video.planes import layout, planes

if TYPE_CHECKING:
    import av

Item = TypeVar("Item")
Decode = Callable[["av.VideoFrame", slice, Path], Item]
COLORED, SHARE = 0.04, 0.01
"""Chroma, as a part of its whole range, from which on a sample is coloured, and the share of such
samples from which on a picture is. Lossy codecs give grey pictures far less of both."""


def grey_at_first(decode: Decode[Item]) -> Decode[Item]:
    """Return a decoder of depth that refuses the first frame it gets if that is in colours."""
    is_checked = False

    def checked(frame: av.VideoFrame, rows: slice, path: Path) -> Item:
        nonlocal is_checked
        if not is_checked:
            _require_grey(frame, rows, path)
            is_checked = True
        return decode(frame, rows, path)

    return checked


def _require_grey(frame: av.VideoFrame, rows: slice, path: Path) -> None:
    """Raise FormatError if some rows of a frame have chroma, which depth has not."""
    how = layout(frame.format.name)
    if how is None or how.kind != "yuv":
        return
    _, *chroma = planes(frame, rows)
    codes = 2.0**how.bits
    off = [np.abs(plane.astype(np.float32) - 0.5 * codes) / codes for plane in chroma]
    share = float((np.maximum(*off) > COLORED).mean())
    if share > SHARE:
        raise FormatError(
            f"{path}: the lower half of its pictures is in colours, and no depth; where the halves "
            "are for two eyes, take one by --eye left (eye in [video]) and name a file of depth"
        )
