"""Stored samples of decoded frames, without scaling or conversion.

FFmpeg's scaler must not touch values: it rounds to 8 bits in places, and converts RGB to RGB by way
of YUV. It only rearranges the samples of formats with an unusual layout.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import av

Codes = NDArray[Any]

_SORTED = {
    "nv12": "yuv420p",
    "nv21": "yuv420p",
    "nv16": "yuv422p",
    "nv24": "yuv444p",
    "p010le": "yuv420p10le",
    "p012le": "yuv420p12le",
    "p016le": "yuv420p16le",
    "p210le": "yuv422p10le",
    "p216le": "yuv422p16le",
    "p410le": "yuv444p10le",
    "p416le": "yuv444p16le",
    "yuyv422": "yuv422p",
    "yvyu422": "yuv422p",
    "uyvy422": "yuv422p",
    "y210le": "yuv422p10le",
    "0rgb": "rgb24",
    "rgb0": "rgb24",
    "0bgr": "rgb24",
    "bgr0": "rgb24",
    "pal8": "rgb24",
}
"""Formats that are rearranged, each with a format that holds the same samples."""


@dataclass(frozen=True)
class Layout:
    """Layout of a pixel format.

    Attributes
    ----------
    kind : str
        "yuv", "rgb" or "gray".
    bits : int
        Bits of each sample; 16 or 32 for floats.
    is_float : bool
        Whether samples are floats.
    across, down : int
        Luma samples per chroma sample, horizontally and vertically.
    full : bool
        Whether the format implies full range, as JPEG's formats do.
    """

    kind: str
    bits: int
    is_float: bool = False
    across: int = 1
    down: int = 1
    full: bool = False


_KINDS = {"yuv": "yuv", "gray": "gray", "gbr": "rgb"}
_SUBSAMPLING = ((1, 1), (1, 2), (2, 1), (2, 2), (4, 1))


def layout(pixels: str) -> Layout | None:
    """Return the layout of an FFmpeg pixel format; None if it is unsupported."""
    import av

    name = _SORTED.get(pixels, pixels)
    form = av.VideoFormat(name, 16, 16) if name else None
    if form is None or not form.components or "msb" in name:
        return None
    kind = next((kind for start, kind in _KINDS.items() if name.startswith(start)), None)
    bits, is_float = form.components[0].bits, "f16" in name or "f32" in name
    if kind == "yuv":
        across, down = 16 // form.chroma_width(), 16 // form.chroma_height()
        if not form.is_planar or (across, down) not in _SUBSAMPLING:
            return None
        return Layout(kind, bits, is_float, across, down, full=name.startswith("yuvj"))
    if kind is None and form.is_rgb and not form.has_palette and not is_float and bits in (8, 16):
        kind = "rgb"
    return None if kind is None else Layout(kind, bits, is_float, full=kind == "rgb")


def planes(frame: av.VideoFrame, rows: slice) -> list[Codes]:
    """Return planes of some rows of a frame as stored: Y, U, V; R, G, B; or grey.

    Parameters
    ----------
    frame : VideoFrame
        Frame in a format with a layout.
    rows : slice
        Rows of luma; they end on whole rows of chroma.

    Returns
    -------
    list of (h, w) uint8, uint16, float16 or float32
        Chroma planes have their own, smaller size.
    """
    if frame.format.name in _SORTED:
        frame = frame.reformat(format=_SORTED[frame.format.name])
    how = layout(frame.format.name)
    assert how is not None
    if how.kind == "rgb" and not frame.format.name.startswith("gbr"):
        pixels = frame.to_ndarray(format="rgb48le" if how.bits == 16 else "rgb24")
        return [pixels[rows, :, channel] for channel in range(3)]
    count = 1 if how.kind == "gray" else 3
    found = []
    for number in range(count):
        down = how.down if how.kind == "yuv" and number else 1
        found.append(_plane(frame, number, how)[rows.start // down : -(-rows.stop // down)])
    if how.kind == "rgb":
        found = [found[2], found[0], found[1]]
    return found


def _plane(frame: av.VideoFrame, number: int, how: Layout) -> Codes:
    """Return a plane of a planar frame without row padding; it shares the frame's memory."""
    plane = frame.planes[number]
    size = 1 if how.bits <= 8 else how.bits // 8 if how.is_float else 2
    order = ">" if frame.format.is_big_endian else "<"
    kind = np.dtype(f"{order}f{size}" if how.is_float else f"{order}u{size}")
    samples: Codes = np.frombuffer(memoryview(plane), kind)
    return samples.reshape(-1, plane.line_size // size)[: plane.height, : plane.width]
