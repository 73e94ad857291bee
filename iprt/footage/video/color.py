"""Conversion of decoded frames to linear Rec.709 radiance, by the stream's color tags.

Missing tags default to

- matrix: BT.2020 for BT.2020 primaries; else BT.709 with at least 1280 columns or 577 rows, and
  BT.601 below, as in players;
- range: limited for YUV; full for RGB, grey and JPEG's formats;
- transfer: sRGB, as for pictures of 8 bits; linear for floats;
- primaries: BT.2020 with PQ and HLG, else BT.709.

Streams tagged BT.601, BT.709 or BT.2020 use the display curve of BT.1886, a power of 2.4. Radiance
1 is reference white. With PQ and HLG, it is 203 cd/m² (ITU-R BT.2408-7, table 1); for HLG on a
display of 1000 cd/m².
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.images import decode_srgb
from iprt.files.primaries import D65, REC709, to_rec709
from iprt.footage.video.pixel_planes import Codes, Layout, layout, planes

if TYPE_CHECKING:
    import av

Picture = NDArray[np.float32]
UNSPECIFIED = 2
REFERENCE_WHITE = 203.0
"""Diffuse white in PQ and HLG, in cd/m²."""
HLG_PEAK, HLG_GAMMA = 1000.0, 1.2
"""Peak luminance in cd/m² and exponent of HLG's reference display (ITU-R BT.2100-2, table 5)."""
_PQ, _HLG, _LINEAR = 16, 18, 8
_BT1886 = (1, 6, 7, 11, 14, 15)
_GAMMAS = {4: 2.2, 5: 2.8}
_SRGB = 13
BAND = 64
"""Number of rows converted at a time, to stay in the processor's cache."""

# Codes of ITU-T H.273, as FFmpeg uses them.
_LUMA = {
    1: (0.2126, 0.0722),
    4: (0.30, 0.11),
    5: (0.299, 0.114),
    6: (0.299, 0.114),
    7: (0.212, 0.087),
    9: (0.2627, 0.0593),
}
"""Weights of red and blue in luma, by matrix coefficients (H.273, table 4)."""
_C, _DCI = (0.310, 0.316), (0.314, 0.351)
_PRIMARIES = {
    1: REC709,
    4: ((0.67, 0.33), (0.21, 0.71), (0.14, 0.08), _C),
    5: ((0.64, 0.33), (0.29, 0.60), (0.15, 0.06), D65),
    6: ((0.630, 0.340), (0.310, 0.595), (0.155, 0.070), D65),
    7: ((0.630, 0.340), (0.310, 0.595), (0.155, 0.070), D65),
    9: ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), D65),
    11: ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), _DCI),
    12: ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), D65),
    22: ((0.630, 0.340), (0.295, 0.605), (0.155, 0.077), D65),
}
"""Chromaticities (x, y) of red, green, blue and white (H.273, table 2)."""


@dataclass(frozen=True)
class Encoding:
    """Color encoding of a frame, in codes of ITU-T H.273.

    Attributes
    ----------
    layout : Layout
        Layout of the pixel format.
    matrix, transfer, primaries : int
        Matrix coefficients, transfer characteristics and color primaries.
    full : bool
        Whether codes have full range, from 0 to the largest.
    """

    layout: Layout
    matrix: int
    transfer: int
    primaries: int
    full: bool


def encoding_of(frame: av.VideoFrame, path: Path) -> Encoding:
    """Return the encoding of a frame, with defaults for missing tags; `path` names it in errors.

    Raises
    ------
    FormatError
        If the pixel format, matrix, transfer or primaries are not supported.
    """
    how = layout(frame.format.name)
    if how is None:
        raise FormatError(
            f"{path}: its pixel format, {frame.format.name}, is not supported; convert the video, "
            "for example to yuv420p"
        )
    matrix, transfer = int(frame.colorspace), int(frame.color_trc)
    primaries = int(frame.color_primaries)
    if transfer in (0, UNSPECIFIED):
        transfer = _LINEAR if how.is_float else _SRGB
    if primaries in (0, UNSPECIFIED):
        primaries = 9 if transfer in (_PQ, _HLG) or matrix == 9 else 1
    if how.kind != "yuv":
        matrix = 1
    elif matrix in (0, UNSPECIFIED, 3):
        large = frame.width >= 1280 or frame.height > 576
        matrix = 9 if primaries == 9 else 1 if large else 6
    full = _is_full(frame, how)
    for code, known, what in (
        (matrix, _LUMA, "color matrix"),
        (transfer, (*_BT1886, *_GAMMAS, _SRGB, _LINEAR, _PQ, _HLG), "transfer characteristics"),
        (primaries, _PRIMARIES, "color primaries"),
    ):
        if code not in known:
            raise FormatError(
                f"{path}: {what} {code} (ITU-T H.273) not supported; convert it to BT.709"
            )
    return Encoding(how, matrix, transfer, primaries, full)


def has_highlights(pixels: str, transfer: int) -> bool:
    """Return whether a stream can be brighter than reference white: PQ, HLG, or floats.

    Parameters
    ----------
    pixels : str
        FFmpeg's name of the pixel format.
    transfer : int
        Transfer characteristics (H.273).
    """
    how = layout(pixels)
    return transfer in (_PQ, _HLG) or (how is not None and how.is_float)


def linear_color(frame: av.VideoFrame, rows: slice, path: Path) -> Picture:
    """Convert rows of a frame to linear Rec.709 radiance (h, W, 3) float32; 1: reference white.

    Colors outside of Rec.709 are negative in a channel. A panorama's chroma is interpolated across
    its seam.

    Raises
    ------
    FormatError
        See `encoding_of`.
    """
    encoding = encoding_of(frame, path)
    stored = planes(frame, rows)
    height, width = stored[0].shape
    chroma = [_upsampled(plane, encoding.layout, height, width) for plane in stored[1:]]
    matrix = to_rec709(_PRIMARIES[encoding.primaries])
    out = np.empty((height, width, 3), np.float32)
    for first in range(0, height, BAND):
        band = slice(first, min(first + BAND, height))
        coded = _coded_rgb([stored[0][band], *(plane[band] for plane in chroma)], encoding)
        linear = _linear(coded, encoding)
        out[band] = linear if matrix is None else linear @ matrix.T
    return out


def luma(frame: av.VideoFrame, rows: slice, path: Path) -> tuple[Codes, float, float]:
    """Return rows of luma or grey as stored, and the codes of black and white.

    Raises
    ------
    FormatError
        If the pixel format has no luma.
    """
    how = layout(frame.format.name)
    if how is None or how.kind == "rgb":
        raise FormatError(
            f"{path}: its pixel format, {frame.format.name}, holds no depth; depth needs grey, "
            "such as gray16le"
        )
    return planes(frame, rows)[0], *_limits(how, _is_full(frame, how))


def _is_full(frame: av.VideoFrame, how: Layout) -> bool:
    """Return whether codes have full range."""
    return how.full or frame.color_range == 2 or (how.kind == "gray" and frame.color_range != 1)


def _limits(how: Layout, full: bool) -> tuple[float, float]:
    """Return the luma codes of black and white."""
    if how.is_float:
        return 0.0, 1.0
    if full:
        return 0.0, float(2**how.bits - 1)
    return 16.0 * 2 ** (how.bits - 8), 235.0 * 2 ** (how.bits - 8)


def _coded_rgb(stored: list[Codes], encoding: Encoding) -> list[Picture]:
    """Return non-linear R, G, B, nominally from 0 to 1."""
    how = encoding.layout
    black, white = _limits(how, encoding.full)
    if how.kind != "yuv":
        scaled = [(plane.astype(np.float32) - black) / (white - black) for plane in stored]
        return scaled if len(scaled) == 3 else scaled * 3
    y = (stored[0].astype(np.float32) - np.float32(black)) * np.float32(1.0 / (white - black))
    middle = 2.0 ** (how.bits - 1)
    reach = white if encoding.full else 224.0 * 2 ** (how.bits - 8)
    u, v = ((plane - np.float32(middle)) * np.float32(1.0 / reach) for plane in stored[1:])
    red, blue = _LUMA[encoding.matrix]
    green = 1.0 - red - blue
    from_v, from_u = 2.0 * (1.0 - red), 2.0 * (1.0 - blue)
    return [
        y + np.float32(from_v) * v,
        y - np.float32(red * from_v / green) * v - np.float32(blue * from_u / green) * u,
        y + np.float32(from_u) * u,
    ]


def _linear(coded: list[Picture], encoding: Encoding) -> Picture:
    """Return linear radiance (h, w, 3) of non-linear channels."""
    stacked = np.stack(coded, axis=-1)
    if encoding.transfer == _LINEAR:
        return stacked
    table = _table(encoding.transfer)
    steps = len(table) - 1
    with np.errstate(invalid="ignore"):
        at = np.nan_to_num(np.clip(stacked, 0.0, 1.0)) * np.float32(steps) + np.float32(0.5)
    linear = table[at.astype(np.uint16)]
    if encoding.transfer == _HLG:
        red, blue = _LUMA[9]
        weights = np.array([red, 1.0 - red - blue, blue], np.float32)
        # The display's OOTF scales by luminance, which preserves hues (BT.2100-2, table 5).
        scene = linear @ weights
        linear = linear * (scene ** np.float32(HLG_GAMMA - 1.0))[..., None]
    return linear


@lru_cache(maxsize=16)
def _table(transfer: int) -> Picture:
    """Return linear values (65536,) of non-linear ones from 0 to 1; for HLG, before its OOTF."""
    e = np.arange(65536) / 65535.0
    if transfer == _SRGB:
        return decode_srgb(np.arange(65536, dtype=np.uint16))
    if transfer == _PQ:
        # SMPTE ST 2084, as in BT.2100-2, table 4.
        m1, m2 = 2610 / 16384, 2523 / 4096 * 128
        c1, c2, c3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
        power = e ** (1 / m2)
        linear = (np.maximum(power - c1, 0.0) / (c2 - c3 * power)) ** (1 / m1)
        linear *= 10_000.0 / REFERENCE_WHITE
    elif transfer == _HLG:
        a, b = 0.17883277, 1 - 4 * 0.17883277
        c = 0.5 - a * np.log(4 * a)
        linear = np.where(e <= 0.5, e * e / 3.0, (np.exp((e - c) / a) + b) / 12.0)
        # Scale so that the OOTF, whose power follows later, ends at the display's peak.
        linear *= (HLG_PEAK / REFERENCE_WHITE) ** (1.0 / HLG_GAMMA)
    else:
        linear = e ** _GAMMAS.get(transfer, 2.4)
    return linear.astype(np.float32)


def _upsampled(plane: Codes, how: Layout, height: int, width: int) -> Picture:
    """Upsample chroma to every luma sample, linearly.

    Chroma is sited at the default of MPEG-2 to HEVC: at every other luma sample of a row, and
    midway between two rows.
    """
    chroma = plane.astype(np.float32)
    across, down = how.across, how.down
    while across > 1:
        wider = np.empty((chroma.shape[0], 2 * chroma.shape[1]), np.float32)
        wider[:, 0::2] = chroma
        wider[:, 1::2] = 0.5 * (chroma + np.roll(chroma, -1, axis=1))
        chroma, across = wider, across // 2
    if down == 2:
        above = np.concatenate([chroma[:1], chroma[:-1]])
        below = np.concatenate([chroma[1:], chroma[-1:]])
        higher = np.empty((2 * chroma.shape[0], chroma.shape[1]), np.float32)
        higher[0::2] = 0.75 * chroma + 0.25 * above
        higher[1::2] = 0.75 * chroma + 0.25 * below
        chroma = higher
    return chroma[:height, :width]
