"""Intel Open Image Denoise, an optional dependency, for path-traced references."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError

Image = NDArray[np.float32]
SEAM = 64
"""Columns copied across a panorama's seam as context for the filter."""


def denoise(color: Image, albedo: Image, normal: Image, *, wrap: bool) -> Image:
    """Return the denoised radiance (H, W, 3).

    Parameters
    ----------
    color, albedo, normal : (H, W, 3) float32
        Linear radiance, and guides assumed to be noise-free.
    wrap : bool
        The image is a panorama: its left and right edges meet.

    Raises
    ------
    IprtError
        If pyoidn is not installed.
    """
    try:
        import pyoidn
    except ImportError as error:
        raise IprtError(
            f"denoising needs pyoidn ({error}): pip install 'iprt[reference]', or --no-denoise"
        ) from None
    seam = min(SEAM, color.shape[1]) if wrap else 0
    padded = [
        np.pad(image, ((0, 0), (seam, seam), (0, 0)), mode="wrap") if wrap else image
        for image in (color, albedo, normal)
    ]
    clean: Image = pyoidn.denoise(
        *(np.ascontiguousarray(image, np.float32) for image in padded), hdr=True, clean_aux=True
    )
    return np.ascontiguousarray(clean[:, seam : seam + color.shape[1]])
