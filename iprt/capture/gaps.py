"""Filling of texels between samples, and of unseen ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from iprt.footage.push_pull import push_pull

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


def fill(values: Float, known: Mask) -> Float:
    """Fill the unknown values (H, W, C) from their surroundings, across the seam too.

    Without any known value, the result is 0.
    """
    weight = known.astype(np.float64)
    return push_pull(values * weight[..., None], weight, blended=True).astype(np.float32)
