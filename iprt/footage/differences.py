"""Texels in which pictures of consecutive frames differ."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def differing(before: NDArray[Any], now: NDArray[Any]) -> NDArray[np.bool_]:
    """Return the texels (H, W) of two pictures (H, W, ...) that differ in any bit.

    The pictures have the same shape and type, of one or four bytes.
    """
    if before is now:
        return np.zeros(now.shape[:2], bool)
    words = np.uint32 if now.itemsize == 4 else np.uint8
    differ = before.view(words) != now.view(words)
    return np.asarray(differ.any(axis=-1) if differ.ndim > 2 else differ)
