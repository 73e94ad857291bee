"""Texels between samples and those never seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from iprt.footage.push_pull import push_pull

GAP_TEXELS = 4
"""Gaps between samples are no wider than twice as much; what is wider was never seen."""

Float = NDArray[np.float32]
Mask = NDArray[np.bool_]


def gaps(seen: Mask) -> Mask:
    """Texels (H, W) of an equirect picture that were not seen, between those that were."""
    size = 2 * GAP_TEXELS + 2
    rows = np.pad(seen, ((size, size), (0, 0)), mode="reflect" if len(seen) > size else "edge")
    wrapped = np.pad(rows, ((0, 0), (size, size)), mode="wrap")
    disc = np.hypot(*np.ogrid[-GAP_TEXELS : GAP_TEXELS + 1, -GAP_TEXELS : GAP_TEXELS + 1])
    closed = ndimage.binary_closing(wrapped, disc <= GAP_TEXELS)
    inside = closed[size:-size, size:-size]
    return np.asarray(inside & ~seen)


def fill(values: Float, known: Mask) -> Float:
    """Return values (H, W, C) with those that are not known filled from around.

    0 where nothing is known.
    """
    weight = known.astype(np.float64)
    return push_pull(values * weight[..., None], weight, blended=True).astype(np.float32)
