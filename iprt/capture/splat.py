"""Rendering of a cloud from a point, as an equirect picture of depth-tested discs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from iprt.capture.cloud import CELL_M, SLOTS, Samples
from iprt.footage.cells import binned
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel

MIN_RADIUS_M = CELL_M / SLOTS**0.5
"""Typical distance of samples in a full cell."""
MIN_TEXELS = 1.0
"""Half the width of the smallest disc, in texels of the equator."""
MAX_TEXELS = 12
"""Half the height of the largest window around a disc."""
MAX_STRETCH = 8
"""Largest ratio of a window's width to its height; discs near the poles are cut off."""
SAME_SURFACE = 0.03
"""Relative distance behind the nearest disc up to which discs are blended with it."""
CLIPPED_WEIGHT = 1e-3
"""Weight of clipped colors, so that unclipped ones of the same surface dominate."""
AT_ONCE = 2**18
"""Number of samples drawn at once, which bounds memory."""

Float = NDArray[np.float32]


def splat(samples: Samples, width: int) -> tuple[Float, Float]:
    """Render samples from the origin into an equirect picture of `width` x `width` / 2 texels.

    Returns
    -------
    color : (H, W, 3) float32
        Linear radiance; 0 without a sample.
    depth : (H, W) float32
        Metres along the ray of the texel's centre; 0 without a sample.
    """
    view = View(width, width // 2, projection="equirect")
    directions = view.directions().reshape(-1, 3).astype(np.float32)
    nearest = np.full(len(directions), np.inf, np.float32)
    for texel, distance, _, _ in _discs(samples, directions, view):
        np.minimum.at(nearest, texel, distance)
    sums = np.zeros((5, len(directions)))
    colors = np.zeros((len(directions), 4))
    for texel, distance, weight, index in _discs(samples, directions, view):
        front = distance <= nearest[texel] * (1.0 + SAME_SURFACE)
        texel, weight, index = texel[front], weight[front], index[front]
        sums[0] += np.bincount(texel, weight, len(directions))
        sums[1] += np.bincount(texel, weight * distance[front], len(directions))
        weight = weight * np.where(samples.clipped[index], np.float32(CLIPPED_WEIGHT), 1.0)
        seen = np.c_[samples.color[index], np.ones(len(index), np.float32)]
        colors += binned(weight[:, None] * seen, texel, len(directions))
    there = sums[0] > 0.0
    color = colors[:, :3] / np.where(there, colors[:, 3], 1.0)[:, None]
    depth = np.where(there, sums[1] / np.where(there, sums[0], 1.0), 0.0)
    shape = (view.height, view.width)
    return color.reshape(*shape, 3).astype(np.float32), depth.reshape(shape).astype(np.float32)


def _discs(
    samples: Samples, directions: Float, view: View
) -> Iterator[tuple[NDArray[np.intp], Float, Float, NDArray[np.intp]]]:
    """Yield the texels of discs, with the disc's distance in each, its weight and its sample."""
    distance = np.linalg.norm(samples.position, axis=1)
    texel_angle = np.float32(2.0 * np.pi / view.width)
    radius = np.maximum(2.0 * samples.radius, np.float32(MIN_RADIUS_M))
    radius = np.maximum(radius, MIN_TEXELS * texel_angle * distance).astype(np.float32)
    half = np.ceil(radius / np.maximum(distance * texel_angle, 1e-9))
    half = np.clip(half, 1, MAX_TEXELS).astype(np.intp)
    sine = np.hypot(samples.position[:, 0], samples.position[:, 2]) / np.maximum(distance, 1e-9)
    stretch = np.clip(np.exp2(np.ceil(np.log2(1.0 / np.maximum(sine, 1e-6)))), 1, MAX_STRETCH)
    pixel = equirect_pixel(samples.position.astype(np.float64), view.width, view.height)
    column, row = np.moveaxis(np.floor(pixel).astype(np.intp), -1, 0)
    kind = half * 64 + stretch.astype(np.intp)
    order = np.argsort(kind, kind="stable")
    order = order[distance[order] > 1e-6]
    starts = np.flatnonzero(np.diff(kind[order], prepend=-1))
    for group in np.split(order, starts[1:]):
        if not len(group):
            continue
        high = int(half[group[0]])
        wide = min(high * int(stretch[group[0]]), (view.width - 1) // 2)
        for part in np.split(group, range(AT_ONCE, len(group), AT_ONCE)):
            along = (samples.normal[part] * samples.position[part]).sum(axis=1)
            for dy in range(-high, high + 1):
                down = row[part] + dy
                for dx in range(-wide, wide + 1):
                    texel = np.clip(down, 0, view.height - 1) * view.width
                    texel += (column[part] + dx) % view.width
                    d = directions[texel]
                    facing = (d * samples.normal[part]).sum(axis=1)
                    with np.errstate(divide="ignore", invalid="ignore"):
                        t = along / facing
                    offset = t[:, None] * d - samples.position[part]
                    ratio = (offset * offset).sum(axis=1) / (radius[part] * radius[part])
                    hit = (down >= 0) & (down < view.height) & (ratio < 1.0) & (t > 0.0)
                    yield texel[hit], t[hit], (1.0 - ratio[hit]), part[hit]
