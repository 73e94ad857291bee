"""EXIF orientation: the rotation or reflection that turns a stored picture upright."""

from __future__ import annotations

from typing import TypeVar
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Scalar = TypeVar("Scalar", bound=np.generic)

TAG = 0x0112
"""Tag number in EXIF and TIFF."""
TURNED = (5, 6, 7, 8)
"""Orientations that swap width and height."""


def orientation_of(image: Image.Image) -> int:
    """Return the EXIF orientation of an opened picture, 1 to 8; 1 if it has no valid one.

    In a PNG whose pixels have not been read, only chunks before the pixels count.
    """
    if image.format == "PNG" and "exif" not in image.info:
        return 1  # Pillow would decode the picture to find later chunks
    with catch_warnings():
        simplefilter("ignore")  # Pillow warns of some damage to EXIF, and raises for other
        try:
            return valid_orientation(image.getexif().get(TAG))
        except Exception:
            return 1  # the pixels may be intact


def valid_orientation(value: object) -> int:
    """Return a tag's value, or 1 if it is no orientation."""
    return value if isinstance(value, int) and 1 <= value <= 8 else 1


def upright(pixels: NDArray[Scalar], orientation: int) -> NDArray[Scalar]:
    """Return pixels (H, W, ...) in upright orientation, sharing memory.

    Parameters
    ----------
    orientation : int
        Sides where the first stored row and column are seen: 1 top, left; 2 top, right; 3 bottom,
        right; 4 bottom, left; 5 left, top; 6 right, top; 7 right, bottom; 8 left, bottom (EXIF
        2.32).
    """
    if orientation in TURNED:
        pixels = pixels.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels


def as_stored(pixels: NDArray[Scalar], orientation: int) -> NDArray[Scalar]:
    """Return upright pixels (H, W, ...) as they were stored: the inverse of `upright`."""
    return upright(pixels, {6: 8, 8: 6}.get(orientation, orientation))
