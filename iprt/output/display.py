"""Display-referred pictures of linear radiance: exposure, clipping, and the sRGB curve."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError

Image = NDArray[np.float64]


def srgb_encode(linear: NDArray[Any]) -> Image:
    """Return the sRGB transfer curve (IEC 61966-2-1) of linear values in [0, 1]."""
    values = np.asarray(linear, np.float64)
    curved = 1.055 * np.power(np.maximum(values, 0.0031308), 1.0 / 2.4) - 0.055
    return np.where(values <= 0.0031308, 12.92 * values, curved)


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
