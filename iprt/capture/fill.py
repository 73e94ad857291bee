"""Filling of texels between samples, and of unseen ones, by push-pull.

After Marroquim et al. (2007), as in *Natural Environment Illumination*. Means of known texels at
half the size, computed recursively, fill unknown texels at the size above.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

GAP_TEXELS = 4
"""Gaps between samples are at most twice this width; wider ones count as unseen."""

Float = NDArray[np.float32]
Mask = NDArray[np.bool_]


def gaps(seen: Mask) -> Mask:
    """Return the texels (H, W) of an equirect picture that lie in gaps between seen ones."""
    size = 2 * GAP_TEXELS + 2
    rows = np.pad(seen, ((size, size), (0, 0)), mode="reflect" if len(seen) > size else "edge")
    wrapped = np.pad(rows, ((0, 0), (size, size)), mode="wrap")
    disc = np.hypot(*np.ogrid[-GAP_TEXELS : GAP_TEXELS + 1, -GAP_TEXELS : GAP_TEXELS + 1])
    closed = ndimage.binary_closing(wrapped, disc <= GAP_TEXELS)
    inside = closed[size:-size, size:-size]
    return np.asarray(inside & ~seen)


def push_pull(values: Float, known: Mask) -> Float:
    """Fill the unknown values (H, W, C) from their surroundings, across the seam too.

    Without any known value, the result is 0.
    """
    return _filled(values.astype(np.float64) * known[..., None], known.astype(np.float64)).astype(
        np.float32
    )


def _filled(total: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fill recursively; `total` is the values times their weight, which is in [0, 1]."""
    own = total / np.maximum(weight, 1e-12)[..., None]
    height, width = weight.shape
    if width == 1 and height == 1:
        return own
    half = _filled(np.asarray(_halved(total)), np.minimum(np.asarray(_halved(weight)), 1.0))
    share = np.minimum(weight, 1.0)[..., None]
    return share * own + (1.0 - share) * _doubled(half, height, width)


def _halved(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Average 2 x 2 blocks; odd sides are extended across the seam, or by the last row."""
    if values.shape[0] % 2:
        values = np.concatenate([values, values[-1:]], axis=0)
    if values.shape[1] % 2:
        values = np.concatenate([values, values[:, :1]], axis=1)
    pairs = values[0::2] + values[1::2]
    return np.asarray(0.25 * (pairs[:, 0::2] + pairs[:, 1::2]))


def _doubled(values: NDArray[np.float64], height: int, width: int) -> NDArray[np.float64]:
    """Upsample bilinearly, across the seam, to twice the size, cropped to (height, width)."""
    above = np.concatenate([values[:1], values[:-1]])
    below = np.concatenate([values[1:], values[-1:]])
    tall = np.empty((2 * len(values), *values.shape[1:]))
    tall[0::2], tall[1::2] = 0.75 * values + 0.25 * above, 0.75 * values + 0.25 * below
    left, right = np.roll(tall, 1, axis=1), np.roll(tall, -1, axis=1)
    wide = np.empty((len(tall), 2 * tall.shape[1], *tall.shape[2:]))
    wide[:, 0::2], wide[:, 1::2] = 0.75 * tall + 0.25 * left, 0.75 * tall + 0.25 * right
    return wide[:height, :width]
