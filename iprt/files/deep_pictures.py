"""Pictures decoded by FFmpeg: Radiance HDR, and formats that Pillow reads in 8 bits or not at all.

Pillow keeps 8 of 16 bits of color, and reads no floats in three channels.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.safe_reading import MAX_PIXELS, decoding, open_file, require_picture_size

if TYPE_CHECKING:
    import av

DAMAGED = "cut off or damaged picture"
_HDR_SIZE = re.compile(rb"\n\n([-+])([XY]) (\d{1,6}) ([-+])([XY]) (\d{1,6})\n")
_HEADER_BYTES = 2**16


def decoded_by_ffmpeg(path: Path, codec: str, data: bytes) -> NDArray[Any]:
    """Decode a picture (H, W, 3) as stored, uint16 or float32; grey is repeated.

    Call it only after Pillow has opened the file: FFmpeg unpacks PNG texts of any size, Pillow
    refuses large ones.

    Parameters
    ----------
    path : Path
        Name of the file in errors.
    codec : str
        FFmpeg's name of the decoder: png, tiff or hdr.
    data : bytes
        Contents of the file.

    Raises
    ------
    FormatError
        The picture is damaged, or has another layout of samples.
    """
    import av

    with decoding(path, DAMAGED):
        try:
            context = cast("av.VideoCodecContext", av.CodecContext.create(codec, "r"))
            context.options = {"err_detect": "crccheck+explode", "max_pixels": str(MAX_PIXELS)}
            (frame,) = context.decode(av.Packet(data))
        except av.FFmpegError as error:
            raise FormatError(f"{path}: {DAMAGED} ({error.strerror})") from error
        return _samples(frame)


def _samples(frame: av.VideoFrame) -> NDArray[Any]:
    name, width = frame.format.name, frame.width
    size = 4 if "f32" in name else 2
    order = ">" if frame.format.is_big_endian else "<"
    kind = np.dtype(f"{order}f4" if size == 4 else f"{order}u2")
    rows = [
        np.frombuffer(memoryview(plane), kind).reshape(frame.height, -1) for plane in frame.planes
    ]
    if name.startswith("gbr"):
        columns = [rows[plane][:, :width] for plane in (2, 0, 1)]
    else:
        channels = len(frame.format.components)
        chosen = range(3) if channels >= 3 else [0, 0, 0]
        columns = [rows[0][:, channel : width * channels : channels] for channel in chosen]
    return np.stack(columns, axis=-1).astype(kind.newbyteorder("="))


def hdr_size(path: Path) -> tuple[int, int]:
    """Return width and height of a Radiance HDR picture.

    Raises
    ------
    FormatError
        The file is damaged, in CIE XYZ, or not stored from the top and left to right.
    """
    with open_file(path) as file:
        start = file.read(_HEADER_BYTES)
    if b"\nFORMAT=32-bit_rle_xyze" in start:
        raise FormatError(f"{path}: stores CIE XYZ; save it with RGB (32-bit_rle_rgbe), or as EXR")
    found = _HDR_SIZE.search(start)
    if found is None:
        raise FormatError(f"{path}: damaged Radiance HDR file (its header gives no size)")
    if (found[1], found[2], found[4], found[5]) != (b"-", b"Y", b"+", b"X"):
        raise FormatError(
            f"{path}: a Radiance HDR file whose rows do not begin top left; save it again"
        )
    width, height = int(found[6]), int(found[3])
    require_picture_size(path, width, height)
    return width, height
