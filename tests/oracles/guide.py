"""Slow numpy twins: neighbourhoods of pixels as the image-space passes see them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bordered(image: Array, reach: int, equirect: bool, fill: float = 0.0) -> Array:
    """(..., H + 2 reach, W + 2 reach): `fill` outside, in equirect views wrapped left and right."""
    still = [(0, 0)] * (image.ndim - 2)
    tall = np.pad(image, [*still, (reach, reach), (0, 0)], constant_values=fill)
    sides = [*still, (0, 0), (reach, reach)]
    if equirect:
        return np.pad(tall, sides, mode="wrap")
    return np.pad(tall, sides, constant_values=fill)


def shifted(image: Array, dx: int, dy: int, equirect: bool, fill: float = 0.0) -> Array:
    """Each pixel's neighbour at (+dx, +dy), `fill` where that is outside the picture."""
    reach = max(abs(dx), abs(dy), 1)
    wide = bordered(image, reach, equirect, fill)
    height, width = image.shape[-2:]
    return wide[..., reach + dy : reach + dy + height, reach + dx : reach + dx + width]


def falloff(x: Array) -> Array:
    return np.maximum(1.0 - x / 8.0, 0.0) ** 8


def luminance(rgb: Array) -> Array:
    """(...) from (3, ...)."""
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]


def shown(signal: Array) -> Array:
    """The scalar that the picture shows: luminance of E_R - E_RV (6 planes) or of the signal."""
    return luminance(signal[:3] - signal[3:] if len(signal) == 6 else signal)
