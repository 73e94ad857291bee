"""Colours of vertices and faces, as textures of two by two texels for each triangle.

Between texels of the colours a, b, c and b + c - a, at the corners of a square, bilinear
interpolation is linear: a triangle with its texture coordinates at the first three has the colours
between its corners that glTF asks for (Khronos glTF 2.0, section 3.7.2.1), up to the half floats of
devices, and touches no texel of others. Triangles that are near each other are so in the texture,
too, on all levels of a pyramid: what is smaller than a pixel has the mean of its surroundings.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.files.images import decode_srgb
from iprt.geometry.gltf_numbers import COLOR_KEY

Float32 = NDArray[np.float32]
Ints = NDArray[np.int64]

_CURVE_BITS = 10
"""Cells a side of the grid along which triangles are sorted, as a power of two."""


def corner_colors(geometry: Any, triangles: Ints, kept: Ints) -> Float32 | None:
    """Return the colours at the corners of triangles of a trimesh geometry.

    Parameters
    ----------
    triangles : (F, 3) int64
        Vertices of the triangles that are kept.
    kept : (F,) int64
        Their numbers among all of the geometry.

    Returns
    -------
    (F, 3, 3) float32 or None
        Linear RGB from 0 to 1 by triangle and corner; None: there are none. Colours of glTF are
        linear, others sRGB.
    """
    given, visual = geometry.vertex_attributes.get(COLOR_KEY), geometry.visual
    if given is not None:
        rgb = np.asarray(given)[:, :3]
        top = np.iinfo(rgb.dtype).max if rgb.dtype.kind in "iu" else 1.0
        rgb = np.clip(np.nan_to_num(rgb.astype(np.float32) / np.float32(top)), 0.0, 1.0)
        return np.asarray(rgb[triangles], np.float32)
    if visual.kind == "vertex":
        return decode_srgb(np.asarray(visual.vertex_colors)[:, :3])[triangles]
    if visual.kind == "face":
        of_face = decode_srgb(np.asarray(visual.face_colors)[kept, :3])
        return np.repeat(of_face[:, None], 3, axis=1)
    return None


def color_texture(centers: NDArray[np.floating], colors: Float32) -> tuple[Float32, Float32]:
    """Return a texture with the colours of triangles, and where in it their corners are.

    Parameters
    ----------
    centers : (F, 3) floating
        Finite; where the triangles are. At least one.
    colors : (F, 3, 3) float32
        Linear RGB by triangle and corner.

    Returns
    -------
    texture : (H, W, 3) float32
        Row 0 at v = 1; H and W are powers of two. Texels that lie in no triangle may be below 0 or
        above 1.
    uvs : (F, 3, 2) float32
        By triangle and corner.
    """
    count = len(colors)
    bits = int(count - 1).bit_length()
    columns, rows = 1 << (bits + 1) // 2, 1 << bits // 2
    order = np.argsort(_along_curve(centers), kind="stable")
    tile = np.arange(columns * rows)
    column, row = _every_other_bit(tile), _every_other_bit(tile >> 1)
    a, b, c = np.moveaxis(colors[order[np.minimum(tile, count - 1)]], 1, 0)
    texture = np.empty((2 * rows, 2 * columns, 3), np.float32)
    for texel, color in (((0, 0), a), ((0, 1), b), ((1, 0), c), ((1, 1), b + c - a)):
        texture[2 * row + texel[0], 2 * column + texel[1]] = color
    corner = np.array([[0, 0], [1, 0], [0, 1]])
    at = 2 * np.stack([column, row], axis=1)[:count, None] + corner + 0.5
    uvs = np.empty((count, 3, 2), np.float32)
    uvs[order] = np.stack([at[..., 0] / (2 * columns), 1.0 - at[..., 1] / (2 * rows)], axis=-1)
    return texture, uvs


def _along_curve(points: NDArray[np.floating]) -> Ints:
    """Return numbers (N,) of cells along a Morton curve through points (N, 3)."""
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
    """Return bits 0, 2, 4, ... of numbers, side by side: the column of a cell of a Morton curve."""
    found = np.zeros_like(numbers)
    for bit in range(16):
        found |= (numbers >> (2 * bit) & 1) << bit
    return found
