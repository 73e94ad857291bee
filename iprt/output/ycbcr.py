"""Video encoding of displayed pictures: Y'CbCr by ITU-R BT.709, limited range, 4:2:0.

Done here, because FFmpeg's conversion brightens pictures by half a step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

LUMA_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
SPLIT = np.stack(
    [
        LUMA_WEIGHTS,
        ([0.0, 0.0, 1.0] - LUMA_WEIGHTS) * 0.5 / (1.0 - LUMA_WEIGHTS[2]),
        ([1.0, 0.0, 0.0] - LUMA_WEIGHTS) * 0.5 / (1.0 - LUMA_WEIGHTS[0]),
    ]
).astype(np.float32)
"""R'G'B' to Y', Cb and Cr."""
LUMA, CHROMA = (16.0, 219.0), (128.0, 224.0)
"""Code of 0, and codes from 0 to 1, in 8 bits; chroma runs from -0.5 to 0.5."""


def ycbcr420(shown: NDArray[np.floating], bits: int) -> NDArray[Any]:
    """Return the planes of a picture.

    Chroma samples lie at decoders' default position: on the left one of two columns, and between
    two rows.

    Parameters
    ----------
    shown : (H, W, 3) float
        In [0, 1]; H and W even.
    bits : int
        8, or up to 16.

    Returns
    -------
    (3 H / 2, W) uint8, or uint16 for more bits
        Luma, and below it Cb and Cr, with two of their rows side by side in one.
    """
    height, width, _ = shown.shape
    dtype = np.uint8 if bits == 8 else np.uint16
    split = np.ascontiguousarray(
        (shown.astype(np.float32, copy=False) @ SPLIT.T).transpose(2, 0, 1)
    )
    planes = np.empty((height * 3 // 2, width), dtype)
    planes[:height] = _coded(split[0], *LUMA, bits, dtype)
    chroma = planes[height:].reshape(2, height // 2, width // 2)
    chroma[...] = _coded(_halved(split[1:]), *CHROMA, bits, dtype)
    return planes


def _halved(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return half the rows and columns of planes (2, H, W)."""
    rows = np.pad(planes[:, 0::2] + planes[:, 1::2], ((0, 0), (0, 0), (1, 0)), mode="edge")
    left, middle, right = rows[..., 0:-1:2], rows[..., 1::2], rows[..., 2::2]
    return np.asarray((left + 2.0 * middle + right) * 0.125, np.float32)


def _coded(
    values: NDArray[np.float32], zero: float, codes: float, bits: int, dtype: DTypeLike
) -> NDArray[Any]:
    step = 2.0 ** (bits - 8)
    coded = np.rint(values * np.float32(codes * step) + np.float32(zero * step))
    return np.asarray(coded, dtype)
