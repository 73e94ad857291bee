"""Detection of pictures given as depth, such as the other eye's view or ambient occlusion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.footage.video.depth_code import MAX_WHITE, DepthCode
from iprt.footage.video.pixel_planes import layout, planes

if TYPE_CHECKING:
    import av

Picture = NDArray[np.float32]
Item = TypeVar("Item")
Decode = Callable[["av.VideoFrame", slice, Path], Item]

ALIKE, COPIED = 0.9, 0.99
"""Rank correlations with luminance above which depth is a picture: for stored values within
[0, 1], and beyond. Depth of the measured scenes has -0.4 to 0.02. A grey copy has 1, whatever its
transfer curve."""
SAMPLES = 128
"""Number of rows and columns that are compared."""
LEAST = 64
"""Least number of samples for a correlation."""
COLORED, SHARE = 0.04, 0.01
"""Least chroma of a colored sample, relative to its range, and least share of such samples in a
colored picture. Grey pictures from lossy codecs have far less of both."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def gray_at_first(decode: Decode[Item]) -> Decode[Item]:
    """Wrap a decoder of depth so that it refuses a first frame in colors."""
    is_checked = False

    def checked(frame: av.VideoFrame, rows: slice, path: Path) -> Item:
        nonlocal is_checked
        if not is_checked:
            _require_gray(frame, rows, path)
            is_checked = True
        return decode(frame, rows, path)

    return checked


def _require_gray(frame: av.VideoFrame, rows: slice, path: Path) -> None:
    """Raise FormatError if some rows of a frame have chroma, which depth has not."""
    how = layout(frame.format.name)
    if how is None or how.kind != "yuv":
        return
    _, *chroma = planes(frame, rows)
    codes = 2.0**how.bits
    off = [np.abs(plane.astype(np.float32) - 0.5 * codes) / codes for plane in chroma]
    if float((np.maximum(*off) > COLORED).mean()) > SHARE:
        raise FormatError(
            f"{path}: the lower half of its pictures is in colors, and no depth; where the halves "
            "are for two eyes, take one by --eye left (eye in [video]) and name a file of depth; "
            "false colors cannot be read as depth"
        )


def require_no_picture(path: Path, depth: Picture, color: Picture, code: DepthCode) -> None:
    """Raise FormatError if depth follows the picture's luminance.

    Parameters
    ----------
    path : Path
        Name of the file in errors.
    depth : (H, W) float32
        Metres; 0, negative, NaN or inf where there is no surface.
    color : (H, W, 3) float32
        The picture, linear.
    code : DepthCode
        The meaning of stored depth.
    """
    rows, columns = (slice(None, None, max(1, side // SAMPLES)) for side in depth.shape)
    few, luminance = depth[rows, columns], color[rows, columns] @ _LUMINANCE
    there = np.isfinite(few) & (few > 0.0) & np.isfinite(luminance)
    if np.count_nonzero(there) < LEAST:
        return
    stored, luminance = few[there], luminance[there]
    is_unit = code.ends is not None or stored.max() <= MAX_WHITE * (code.scale or 1.0)
    falling = code.ends is not None and code.ends[0] > code.ends[1]
    alike = _rank_correlation(-stored if falling else stored, luminance)
    if alike >= (ALIKE if is_unit else COPIED):
        raise FormatError(
            f"{path}: holds no depth: its values rise and fall with the brightness of the picture "
            f"(rank correlation {alike:.2f}), as of a grey picture or ambient occlusion"
        )


def _rank_correlation(a: Picture, b: Picture) -> float:
    """Return Spearman's rank correlation of two arrays (N,); 0 if one is constant."""
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return 0.0
    return float(np.corrcoef(_ranks(a), _ranks(b))[0, 1])


def _ranks(values: Picture) -> NDArray[np.float64]:
    """Return the rank of each value (N,); equal values share their mean rank."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return (ends - 0.5 * (counts + 1))[place]
