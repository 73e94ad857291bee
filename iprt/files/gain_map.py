"""Gain map of Ultra HDR: the second picture of a JPEG, which holds the highlights.

By Ultra HDR Image Format v1 (Android), with the formulas of Adobe's Gain Map and of ISO 21496-1:
`HDR = (SDR + offset_sdr) * 2^(low + (high - low) * map^(1 / gamma)) - offset_hdr`, with linear SDR,
for a display that shows the full range.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.MpoImagePlugin import MpoImageFile

from iprt.files.safe_reading import decoding, read_bytes, require_picture_size
from iprt.files.xmp import xmp_of, xmp_value

BAND = 64
"""Rows that are brightened at a time."""
MAX_PICTURES = 8
"""Limit for the pictures of a file that are examined."""
MAX_BOOST = 16.0
"""Largest binary logarithm of a gain; PQ needs less than 6."""
_SIGNS = ("hdrgm:Version", "HDRGainMap:", "aux:hdrgainmap")
"""Markers in the XMP of Ultra HDR and of Apple's pictures."""
_ISO = b"urn:iso:std:iso:ts:21496:-1"


@dataclass(frozen=True)
class GainMap:
    """A gain map (h, w, 3) float32, 0 to 1, with its parameters; arrays (3,) hold R, G, B.

    Attributes
    ----------
    low, high : (3,) float32
        Binary logarithms of the gain where the map is 0 and 1.
    gamma, offset_sdr, offset_hdr : (3,) float32
    """

    stored: NDArray[np.float32]
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    gamma: NDArray[np.float32]
    offset_sdr: NDArray[np.float32]
    offset_hdr: NDArray[np.float32]

    def brighten(self, color: NDArray[np.float32]) -> None:
        """Convert linear SDR (H, W, 3) to HDR in place; 1 remains SDR white."""
        height, width = color.shape[:2]
        log_gain = self.low + (self.high - self.low) * self.stored ** (1.0 / self.gamma)
        columns, left, across = _between(log_gain.shape[1], width)
        wide = log_gain[:, columns] * (1 - across) + log_gain[:, left] * across
        rows, above, down = _between(log_gain.shape[0], height)
        for first in range(0, height, BAND):
            band = slice(first, first + BAND)
            part = down[band, None]
            gain = np.exp2(wide[rows[band]] * (1 - part) + wide[above[band]] * part)
            color[band] = (color[band] + self.offset_sdr) * gain - self.offset_hdr


def _between(
    stored: int, wanted: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
    """Return each wanted sample's two stored neighbours and the weight of the second."""
    at = np.clip((np.arange(wanted) + 0.5) * stored / wanted - 0.5, 0.0, stored - 1.0)
    first = at.astype(np.intp)
    second = np.minimum(first + 1, stored - 1)
    return first, second, (at - first)[:, None].astype(np.float32)


def names_gain_map(image: Image.Image) -> bool:
    """Return True if an opened picture declares a gain map of any vendor."""
    xmp = xmp_of(image)
    segments = getattr(image, "applist", ())
    return any(name in xmp for name in _SIGNS) or any(
        name == "APP2" and content.startswith(_ISO) for name, content in segments
    )


def read_gain_map(path: Path) -> GainMap | None:
    """Read the gain map of a JPEG file that declares one.

    Returns
    -------
    GainMap or None
        None for another vendor's map, or if the base picture is already HDR.

    Raises
    ------
    FormatError
        The gain map is damaged.
    """
    with decoding(path, "damaged gain map"):
        with Image.open(path, formats=["JPEG"]) as primary:
            if "mp" not in primary.info:
                return None
            first = xmp_of(primary)
        pictures = MpoImageFile(BytesIO(read_bytes(path)))
        for number in range(1, min(pictures.n_frames, MAX_PICTURES)):
            pictures.seek(number)
            xmp = xmp_of(pictures)
            if xmp_value(xmp, "hdrgm:GainMapMax") is None and not _has_list(xmp, "GainMapMax"):
                xmp = first
            meaning = _meaning(xmp)
            if meaning is None:
                continue
            require_picture_size(path, *pictures.size)
            stored = np.asarray(pictures.convert("RGB"), np.float32) / np.float32(255.0)
            return GainMap(stored, *meaning)
    return None


def _has_list(xmp: str, name: str) -> bool:
    return f"<hdrgm:{name}>" in xmp


def _meaning(xmp: str) -> list[NDArray[np.float32]] | None:
    """Return low, high, gamma and offsets, (3,) each; None if any is missing or out of range."""
    if xmp_value(xmp, "hdrgm:BaseRenditionIsHDR") == "True":
        return None
    defaults = (
        ("GainMapMin", 0.0),
        ("GainMapMax", None),
        ("Gamma", 1.0),
        ("OffsetSDR", 1.0 / 64.0),
        ("OffsetHDR", 1.0 / 64.0),
    )
    values = [_triple(xmp, name, default) for name, default in defaults]
    if any(value is None for value in values):
        return None
    found = [value for value in values if value is not None]
    low, high, gamma = found[:3]
    is_sane = (np.abs(low) <= MAX_BOOST).all() and (np.abs(high) <= MAX_BOOST).all()
    return found if is_sane and (low <= high).all() and (gamma > 0.0).all() else None


def _triple(xmp: str, name: str, default: float | None) -> NDArray[np.float32] | None:
    """Parse a number for all channels, or a list of three, as (3,): R, G, B."""
    found = re.search(rf"<hdrgm:{name}>(.*?)</hdrgm:{name}>", xmp, re.DOTALL)
    texts = re.findall(r"<rdf:li>([^<]*)</rdf:li>", found[1]) if found else []
    one = xmp_value(xmp, f"hdrgm:{name}")
    if not texts:
        texts = [one] if one else []
    try:
        numbers = [float(text) for text in texts] or ([] if default is None else [default])
    except ValueError:
        return None
    if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
        return None
    return np.broadcast_to(np.array(numbers, np.float32), 3).copy()
