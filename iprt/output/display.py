"""Displayed pictures of linear radiance: exposure, tone curve, and 8-bit levels by tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.images import srgb_encode

Image = NDArray[np.float64]
Curve = Literal["srgb", "filmic"]
"""srgb: clipped at 1, as in PNG files. filmic: highlights are compressed by Narkowicz's fit of the
ACES reference curve (Narkowicz, "ACES Filmic Tone Mapping Curve", 2015)."""

Bytes = NDArray[np.uint8]
_CELL_BITS = 13
"""Low bits of a float32 that a table index ignores. A cell spans 2^-10 of its values; 8-bit levels
are further apart, so that at most one starts inside."""


def display(radiance: NDArray[Any], exposure: float = 1.0) -> Image:
    """Return the display-referred image `srgb(clip(exposure * radiance, 0, 1))`.

    Parameters
    ----------
    radiance : (H, W, 3) float
        Linear Rec.709 radiance.
    exposure : float
        Factor before clipping; the scene's `exposure`.

    Returns
    -------
    (H, W, 3) float64, in [0, 1]

    Raises
    ------
    FormatError
        The radiance is not an (H, W, 3) image, or holds NaN or infinity.
    """
    require_radiance(radiance)
    return srgb_encode(np.clip(exposure * radiance.astype(np.float64), 0.0, 1.0))


def require_radiance(radiance: NDArray[Any]) -> None:
    """Raise an error unless radiance can be displayed.

    Raises
    ------
    FormatError
        It is not an (H, W, 3) image, or holds NaN or infinity.
    """
    if radiance.ndim != 3 or radiance.shape[2] != 3 or radiance.size == 0:
        raise FormatError(f"expected an image of shape (H, W, 3), got {radiance.shape}")
    bad = int(np.count_nonzero(~np.isfinite(radiance).all(axis=2)))
    if bad:
        raise FormatError(f"the image holds {bad} pixels with NaN or infinite radiance")


def _filmic(radiance: NDArray[np.float64]) -> NDArray[np.float64]:
    # Cut where the curve is above 1: squares of large values would overflow.
    x = np.minimum(radiance, 1e3)
    return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)


_CURVES: Mapping[Curve, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "srgb": lambda radiance: radiance,
    "filmic": _filmic,
}


def level(radiance: NDArray[Any], exposure: float, curve: Curve) -> NDArray[np.float64]:
    """Return the unrounded level in [0, 255] of linear radiance."""
    exposed = np.maximum(exposure * np.asarray(radiance, np.float64), 0.0)
    return 255.0 * srgb_encode(np.clip(_CURVES[curve](exposed), 0.0, 1.0))


def developed(radiance: NDArray[np.float32], exposure: float = 1.0, curve: Curve = "srgb") -> Bytes:
    """Return the displayed picture: `rint(level(radiance, exposure, curve))`, to the bit.

    Parameters
    ----------
    radiance : (...) float32
        Linear Rec.709. Negative values are black; NaN is white, to be seen.
    exposure : float
        Factor; at least 0.
    curve : {"srgb", "filmic"}

    Returns
    -------
    (...) uint8
    """
    below, last = _table(float(exposure), curve)
    # As integers, floats of one sign have the same order, and negative ones are negative.
    bits = np.ascontiguousarray(radiance, np.float32).view(np.int32)
    bits = np.maximum(bits, 0)
    cell = bits >> _CELL_BITS
    shown: Bytes = below[cell]
    shown += bits > last[cell]
    return shown


@lru_cache(maxsize=8)
def _table(exposure: float, curve: Curve) -> tuple[Bytes, NDArray[np.int32]]:
    """Return, per cell of float32 values, the level at its start and that level's end."""
    first = _first_bits(exposure, curve)
    begins = np.arange(1 << (31 - _CELL_BITS), dtype=np.int64) << _CELL_BITS
    below = np.searchsorted(first, begins, side="right")
    last = np.append(first - 1, np.iinfo(np.int32).max)[below]
    return below.astype(np.uint8), last.astype(np.int32)


def _first_bits(exposure: float, curve: Curve) -> NDArray[np.int64]:
    """Return the (255,) least float32 displayed as level 1, 2, ... 255, as bits, by bisection."""
    infinity = int(np.float32(np.inf).view(np.int32))
    wanted = np.arange(1, 256)
    low = np.zeros(255, np.int64)  # values never reached, except by an infinite exposure
    high = np.full(255, infinity, np.int64)
    while int((high - low).max()) > 1:
        middle = (low + high) // 2
        radiance = middle.astype(np.int32).view(np.float32)
        reached = np.rint(level(radiance, exposure, curve)) >= wanted
        low, high = np.where(reached, low, middle), np.where(reached, middle, high)
    return high
