"""Mip levels of the textures that rays read (`cl/lib/world/objects/textures.h`).

Each level is half as wide and high as the one before, rounded down, and at least 1. A texel is the
mean over its area, so that all levels have the image's mean, whatever its size.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]


def color_levels(image: Float, opacity: Float | None = None) -> list[Float]:
    """Return the (H, W, 4) levels of an (H, W, 3) image, with opacity, by default 1.

    Colors are weighted by opacity: what lies hidden in holes makes no fringes.
    """
    finest = _padded(image)
    if opacity is None:
        return _levels(finest)
    finest[..., 3] = opacity
    weighted = finest.copy()
    weighted[..., :3] *= opacity[..., None]
    levels = _levels(weighted)
    # From the coarsest on, texels of holes alone get the color around them.
    around = np.zeros((1, 1, 3), np.float32)
    for level in levels[:0:-1]:
        there = level[..., 3:] > 0.0
        mean = level[..., :3] / np.where(there, level[..., 3:], 1.0)
        level[..., :3] = around = np.where(there, mean, _enlarged(around, level.shape))
    return [finest, *levels[1:]]


def finish_levels(image: Float) -> list[Float]:
    """Return the levels of factors of metalness and of the square root of alpha.

    Alpha itself is averaged: the width of a reflection.
    """
    finest = _padded(image)
    squared = finest.copy()
    squared[..., 1] **= 2
    levels = _levels(squared)
    for level in levels:
        level[..., 1] = np.sqrt(level[..., 1])
    return [finest, *levels[1:]]


def normal_levels(image: Float) -> list[Float]:
    """Return the levels of directions of any length, which count alike."""
    finest = _padded(image)
    length = np.linalg.norm(image, axis=-1, keepdims=True)
    directions = (image / np.where(length > 0.0, length, 1.0)).astype(np.float32)
    return [finest, *_levels(_padded(directions))[1:]]


def _padded(image: Float) -> Float:
    """Return an image of one to three channels with four, the others 1."""
    height, width, channels = image.shape
    padded = np.ones((height, width, 4), np.float32)
    padded[..., :channels] = image
    return padded


def _levels(finest: Float) -> list[Float]:
    levels = [finest]
    while max(levels[-1].shape[:2]) > 1:
        rows = _halved(levels[-1])
        levels.append(np.ascontiguousarray(_halved(rows.swapaxes(0, 1)).swapaxes(0, 1)))
    return levels


def _halved(image: Float) -> Float:
    """Return an image with half as many rows, rounded down, each the mean over its share."""
    size, half = len(image), len(image) // 2
    if half == 0:
        return image
    first, second = image[0 : 2 * half : 2], image[1 : 2 * half : 2]
    if size == 2 * half:
        return np.float32(0.5) * (first + second)
    # A row covers 2 + 1 / half of the finer ones.
    number = np.arange(half, dtype=np.float32)[:, None, None]
    total = (half - number) * first + half * second + (number + 1.0) * image[2::2]
    mean: Float = (total / size).astype(np.float32)
    return mean


def _enlarged(image: Float, shape: tuple[int, ...]) -> Float:
    """Return an image with as many rows and columns as `shape` by repeating them."""
    rows, columns = (np.arange(shape[axis]) * image.shape[axis] // shape[axis] for axis in (0, 1))
    enlarged: Float = image[rows[:, None], columns]
    return enlarged
