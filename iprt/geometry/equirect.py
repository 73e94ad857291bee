"""The equirect mapping: which direction each texel of a panorama shows.

A panorama is twice as wide as high. Its middle shows -Z, +X lies to the right of it, and +Y is up.
Texel centres are at integer + 0.5. Azimuths are 0 in the middle, polar angles 0 at the top.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


def texel_azimuths(width: int) -> Float:
    """Return the azimuths (width,) of the centres of columns, in rad, from -pi to pi."""
    return ((np.arange(width) + 0.5) / width - 0.5) * 2.0 * np.pi


def texel_polar_angles(height: int) -> Float:
    """Return the polar angles (height,) of the centres of rows, in rad."""
    return (np.arange(height) + 0.5) / height * np.pi


def texel_directions(
    width: int, height: int, rows: slice = slice(None)
) -> tuple[Float, Float, Float]:
    """Return x (rows, width), y (rows, 1) and z (rows, width) of texel centres' unit directions."""
    phi, theta = texel_azimuths(width), texel_polar_angles(height)[rows, None]
    return np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)


def solid_angles(width: int, height: int) -> Float:
    """Return the exact solid angle of a texel of each row (height,), in sr."""
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    return (edges[:-1] - edges[1:]) * (2.0 * np.pi / width)


def equirect_direction(pixels: Float, width: int, height: int) -> Float:
    """Return unit directions (..., 3) of image points (..., 2), in pixels."""
    phi = (pixels[..., 0] / width - 0.5) * 2.0 * np.pi
    theta = pixels[..., 1] / height * np.pi
    return np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1
    )


def equirect_pixel(directions: Float, width: int, height: int) -> Float:
    """Return image points (..., 2), in pixels, x in [0, width), of directions (..., 3)."""
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    phi = np.arctan2(x, -z)
    theta = np.arctan2(np.hypot(x, z), y)
    column = np.mod((phi / (2.0 * np.pi) + 0.5) * width, width)
    return np.stack([column, theta / np.pi * height], axis=-1)


def equirect_texel(
    directions: Float, width: int, height: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return row and column of the texels that directions (..., 3) meet."""
    column, row = np.moveaxis(equirect_pixel(directions, width, height).astype(np.intp), -1, 0)
    return np.minimum(row, height - 1), np.minimum(column, width - 1)


def cell_towards(
    point: NDArray[np.floating], radius: NDArray[np.floating], rows: int
) -> NDArray[np.intp]:
    """Return the numbers of the cells (rows, 2 rows) that points (..., 3) are seen in.

    It is quicker than `equirect_texel`: in single precision if `point` is, by the known distance
    `radius` (...) of the points.
    """
    polar = np.arccos(np.clip(point[..., 1] / np.maximum(radius, 1e-12), -1.0, 1.0))
    azimuth = np.arctan2(point[..., 0], -point[..., 2])
    row = np.minimum((polar * (rows / np.pi)).astype(np.intp), rows - 1)
    column = ((azimuth / (2.0 * np.pi) + 0.5) * 2 * rows).astype(np.intp)
    # Not by the remainder, which takes NumPy longer than the arc tangent; nor does a NaN get out.
    column = np.where((column >= 0) & (column < 2 * rows), column, 0)
    return np.asarray(row * 2 * rows + column)
