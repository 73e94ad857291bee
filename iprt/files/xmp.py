"""XMP properties of a picture: the part of the sphere that it shows (GPano)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from iprt.errors import FormatError

_KEYS = ("xmp", "XML:com.adobe.xmp")
"""Keys of XMP in Pillow's `Image.info`; the second is for PNG."""
_XMP_TAG = 700
"""Tag number in TIFF."""


def xmp_of(image: Image.Image) -> str:
    """Return the XMP of an opened picture; empty if there is none before its pixels."""
    found = next((image.info[key] for key in _KEYS if key in image.info), "")
    if not found and image.format == "TIFF":
        found = image.getexif().get(_XMP_TAG, "")
    return found.decode("utf-8", "replace") if isinstance(found, bytes) else str(found)


def xmp_value(xmp: str, name: str) -> str | None:
    """Return a simple property, such as `GPano:PoseHeadingDegrees`; None if it is missing.

    XMP writes it as an attribute or as an element. The customary prefix is assumed.
    """
    name = re.escape(name)
    found = re.search(rf"""[\s<]{name}(?:\s*=\s*["']([^"'<]*)["']|\s*>([^<]*)<)""", xmp)
    return None if found is None else (found[1] if found[1] is not None else found[2]).strip()


@dataclass(frozen=True)
class Crop:
    """The position of a picture in its panorama: edges as fractions of width and height.

    Attributes
    ----------
    full : (float, float)
        Width and height of the panorama, in pixels of the picture as stored.
    """

    left: float
    top: float
    right: float
    bottom: float
    full: tuple[float, float]


def gpano_crop(path: Path, xmp: str, width: int, height: int) -> Crop | None:
    """Return the crop that GPano describes; None without one, or for the whole panorama.

    A picture scaled after GPano was written keeps its place. The heading is ignored.

    Parameters
    ----------
    path : Path
        Name of the file in errors.
    width, height : int
        Size of the picture.

    Raises
    ------
    FormatError
        The projection is not equirect, or the crop is not inside a panorama of 2:1.
    """
    projection = xmp_value(xmp, "GPano:ProjectionType")
    if projection and projection != "equirectangular":
        raise FormatError(
            f'{path}: its GPano says that its projection is "{projection[:40]}"; an equirect '
            "(equirectangular) panorama is needed"
        )
    names = (
        "CroppedAreaLeftPixels",
        "CroppedAreaTopPixels",
        "CroppedAreaImageWidthPixels",
        "CroppedAreaImageHeightPixels",
        "FullPanoWidthPixels",
        "FullPanoHeightPixels",
    )
    values = [_number(xmp_value(xmp, f"GPano:{name}")) for name in names]
    if any(value is None for value in values):
        return None
    left, top, across, down, full_width, full_height = (value or 0.0 for value in values)
    is_inside = (
        across > 0.0
        and down > 0.0
        and 0.0 <= left <= full_width - across
        and 0.0 <= top <= full_height - down
    )
    if not is_inside or abs(full_width / full_height - 2.0) > 0.02:
        shown = f"{across:g} x {down:g} at ({left:g}, {top:g}) of {full_width:g} x {full_height:g}"
        raise FormatError(
            f"{path}: its GPano places {shown}, which is no part of a panorama twice as wide as "
            "high; correct it, or say by --fit (fit in [video]) how the picture covers the sphere"
        )
    if (across, down) == (full_width, full_height):
        return None
    full = full_width * width / across, full_height * height / down
    return Crop(
        left / full_width,
        top / full_height,
        (left + across) / full_width,
        (top + down) / full_height,
        full,
    )


def _number(text: str | None) -> float | None:
    is_short = text is not None and re.fullmatch(r"-?\d{1,9}(\.\d{0,9})?", text)
    return float(text) if text and is_short else None
