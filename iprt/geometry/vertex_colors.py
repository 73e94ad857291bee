"""Colors of vertices and faces, stored as a texture with 2 x 2 texels for each triangle.

The four texels hold the colors a, b, c and b + c - a, for which bilinear interpolation is linear.
A triangle whose texture coordinates are the first three texel centres therefore interpolates its
vertex colors as glTF requires (Khronos glTF 2.0, section 3.7.2.1), up to the half floats of
devices, and samples no texel of another triangle. Nearby triangles are nearby in the texture too,
on all mip levels, so that triangles smaller than a pixel get the mean of their surroundings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Ints = NDArray[np.int64]

_CURVE_BITS = 10
"""Number of bits per axis of the grid along which triangles are sorted."""


def color_texture(centers: NDArray[np.floating], colors: Float32) -> tuple[Float32, Float32]:
    """Build a texture of triangles' colors, with texture coordinates of their corners.

    Parameters
    ----------
    centers : (F, 3) floating
        Finite centres of the triangles; at least one.
    colors : (F, 3, C) float32
        Linear RGB, or RGB and opacity, by triangle and corner.

    Returns
    -------
    texture : (H, W, C) float32
        Row 0 at v = 1; H and W are powers of two. Texels outside all triangles may be below 0 or
        above 1.
    uvs : (F, 3, 2) float32
        Texture coordinates by triangle and corner.
    """
    count = len(colors)
    bits = int(count - 1).bit_length()
    columns, rows = 1 << (bits + 1) // 2, 1 << bits // 2
    order = np.argsort(_along_curve(centers), kind="stable")
    tile = np.arange(columns * rows)
    column, row = _every_other_bit(tile), _every_other_bit(tile >> 1)
    a, b, c = np.moveaxis(colors[order[np.minimum(tile, count - 1)]], 1, 0)
    texture = np.empty((2 * rows, 2 * columns, colors.shape[2]), np.float32)
    for texel, color in (((0, 0), a), ((0, 1), b), ((1, 0), c), ((1, 1), b + c - a)):
        texture[2 * row + texel[0], 2 * column + texel[1]] = color
    corner = np.array([[0, 0], [1, 0], [0, 1]])
    at = 2 * np.stack([column, row], axis=1)[:count, None] + corner + 0.5
    uvs = np.empty((count, 3, 2), np.float32)
    uvs[order] = np.stack([at[..., 0] / (2 * columns), 1.0 - at[..., 1] / (2 * rows)], axis=-1)
    return texture, uvs


def _along_curve(points: NDArray[np.floating]) -> Ints:
    """Return the (N,) Morton codes of points (N, 3)."""
    low = points.min(axis=0)
    extent = max(float((points.max(axis=0) - low).max()), np.finfo(np.float64).tiny)
    top = (1 << _CURVE_BITS) - 1
    cells = np.minimum((points - low) / extent * top, top).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(_CURVE_BITS):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return code


def _every_other_bit(numbers: Ints) -> Ints:
    """Return bits 0, 2, 4, ... of numbers, packed: the column of a Morton code."""
    found = np.zeros_like(numbers)
    for bit in range(16):
        found |= (numbers >> (2 * bit) & 1) << bit
    return found
