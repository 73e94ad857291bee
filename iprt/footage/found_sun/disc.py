"""The sun's disc where the panorama shows it, in open sky or through an opening."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.frame import LUMINANCE, Frame
from iprt.geometry.equirect import equirect_direction, solid_angles

RADIUS, RING = np.deg2rad(8.0), np.deg2rad(12.0)
"""Radius about the sun that its disc and the lens's bloom reach, and of the sky compared with."""
MOST_BRIGHT = 0.04
"""Largest solid angle, in sr, of sky at least half as bright as its brightest texel."""
MIN_CONTRAST = 1.5
"""Least luminance of a disc relative to the sky around it."""
MIN_RING = 8
"""Least number of texels of sky around a disc."""


def visible_disc(frame: Frame) -> NDArray[np.float64] | None:
    """Return the unit direction (3,) of the one compact bright spot of the sky; None without one.

    The direction is in the axes of the capture centre.
    """
    texel = np.flatnonzero(frame.opening | ~np.isfinite(frame.depth))
    if not len(texel):
        return None
    light = frame.radiance.reshape(-1, 3)[texel] @ LUMINANCE
    bright = light > 0.5 * light.max()
    angle = np.repeat(solid_angles(frame.width, frame.height), frame.width)[texel[bright]]
    if angle.sum() > MOST_BRIGHT:
        return None
    way = _directions(frame, texel[bright])
    middle = (way * (angle * light[bright])[:, None]).sum(axis=0)
    middle /= np.linalg.norm(middle)
    around = _around(frame, middle)
    if around is None or (way @ middle).min() < np.cos(RADIUS):
        return None
    ring = float(around[1] @ LUMINANCE)
    return middle if light.max() > MIN_CONTRAST * ring else None


def without_disc(frame: Frame, direction: NDArray[np.float64]) -> Frame:
    """Return the frame with no more light from a sun's disc than from the sky around it.

    The picture stays as the camera stored it (`Frame.picture`).

    Parameters
    ----------
    frame : Frame
    direction : (3,) float64
        Unit vector towards the sun, in the axes of the capture centre.
    """
    around = _around(frame, direction)
    if around is None:
        return frame
    disc, ring = around
    color = frame.color.reshape(-1, 3)
    disc = disc[color[disc] @ LUMINANCE > MIN_CONTRAST * (ring @ LUMINANCE)]
    if not len(disc):
        return frame
    light = frame.color.copy()
    light.reshape(-1, 3)[disc] = np.minimum(color[disc], ring)
    more = ClippedTexels(disc.astype(np.int32), color[disc])
    clipped = more if frame.clipped is None else frame.clipped.with_others(more)
    return frame.recolored(color=light, clipped=clipped)


def _directions(frame: Frame, texel: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the unit directions (n, 3) of texels' centres."""
    row, column = np.divmod(texel, frame.width)
    return equirect_direction(np.stack([column, row], -1) + 0.5, frame.width, frame.height)


def _around(
    frame: Frame, direction: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float32]] | None:
    """Return the texels (n,) of sky within `RADIUS`, and the median color (3,) of the ring.

    None without sky in both.
    """
    polar = np.arccos(np.clip(direction[1], -1.0, 1.0))
    first, end = ((polar + np.array([-RING, RING])) / np.pi * frame.height).astype(int)
    rows = slice(max(first, 0), end + 1)
    sky = frame.opening[rows] | ~np.isfinite(frame.depth[rows])
    texel = rows.start * frame.width + np.flatnonzero(sky)
    cosine = _directions(frame, texel) @ direction
    disc = texel[cosine > np.cos(RADIUS)]
    ring = texel[(cosine <= np.cos(RADIUS)) & (cosine > np.cos(RING))]
    if not len(disc) or len(ring) < MIN_RING:
        return None
    return disc, np.median(frame.color.reshape(-1, 3)[ring], axis=0)
