"""Which samples a TIFF picture holds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from PIL import TiffImagePlugin

from iprt.errors import FormatError
from iprt.files.orientation import TAG as ORIENTATION
from iprt.files.orientation import valid_orientation
from iprt.files.untrusted import decoding, open_file, require_picture_size

_WIDTH, _HEIGHT, _BITS, _CHANNELS, _FORMAT = 256, 257, 258, 277, 339
_XMP = 700
_UNSIGNED, _FLOAT = 1, 3


@dataclass(frozen=True)
class TiffTags:
    """What the first directory of a TIFF file says.

    Attributes
    ----------
    width, height : int
        As stored.
    bits, channels : int
    is_float : bool
    orientation : int
        As of EXIF.
    xmp : str
    """

    width: int
    height: int
    bits: int
    channels: int
    is_float: bool
    orientation: int
    xmp: str

    @property
    def is_deep(self) -> bool:
        """Whether Pillow would lose bits, or does not read it."""
        return self.channels > 2 and self.bits > 8


def read_tags(path: Path) -> TiffTags:
    """Read the tags of a file.

    Raises
    ------
    FormatError
        Damaged, too large, or of samples that are not read.
    """
    with decoding(path, "damaged TIFF file"), open_file(path) as file:
        start = file.read(8)
        start += file.read(8) if b"+" in start[2:4] else b""  # BigTIFF
        tags = TiffImagePlugin.ImageFileDirectory_v2(start)
        file.seek(tags.next)
        tags.load(file)
        width, height = int(tags[_WIDTH]), int(tags[_HEIGHT])
        bits, formats = set(tags.get(_BITS, (1,))), set(tags.get(_FORMAT, (_UNSIGNED,)))
        channels, xmp = int(tags.get(_CHANNELS, 1)), tags.get(_XMP, b"")
    require_picture_size(path, width, height)
    is_float = formats == {_FLOAT}
    known = bits == {32} if is_float else formats == {_UNSIGNED} and bits <= {1, 2, 4, 8, 16, 32}
    if len(bits) != 1 or not known or (channels > 2 and bits == {32} and not is_float):
        sizes = "/".join(str(size) for size in sorted(bits))
        what = "floats" if _FLOAT in formats else "signed integers" if 2 in formats else "integers"
        raise FormatError(
            f"{path}: a TIFF file of {sizes}-bit {what} in {channels} channels is not read; save "
            "it with 32-bit floats or 8 or 16-bit integers, or as EXR"
        )
    return TiffTags(
        width,
        height,
        bits.pop(),
        channels,
        is_float,
        valid_orientation(tags.get(ORIENTATION)),
        xmp.decode("utf-8", "replace") if isinstance(xmp, bytes) else str(xmp),
    )
