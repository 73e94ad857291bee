"""Rooms lit by lamps, as a camera that clips sees them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from iprt.files.images import srgb_encode
from iprt.footage.frame import Frame
from tests.frame.radiosity import Albedo, Lamp, room
from tests.worlds import Float

PALETTE = np.array(
    [
        *([0.7, 0.3, 0.25], [0.3, 0.6, 0.3]),
        *([0.4, 0.3, 0.2], [0.8, 0.8, 0.75]),
        *([0.5, 0.5, 0.6], [0.2, 0.35, 0.6]),
    ]
)
"""Reflectance of walls at low and high x, y, z."""


def grey(value: float) -> Albedo:
    return lambda points, _: np.full(points.shape, value)


def colored(_: Float, normals: Float) -> Float:
    axis = np.abs(normals).argmax(-1)
    side = np.take_along_axis(normals, axis[:, None], -1)[:, 0] > 0.0
    return PALETTE[2 * axis + side]


def tiled(points: Float, normals: Float) -> Float:
    """Colored walls with tiles of half a metre, every other one darker."""
    odd = np.floor(2.0 * points).sum(-1).astype(int) % 2
    return np.asarray(colored(points, normals) * np.where(odd, 1.0, 0.55)[:, None])


ROOMS: dict[str, Albedo] = {"gray": grey(0.5), "white": grey(0.85), "dark": grey(0.2)}
ROOMS |= {"colored": colored, "tiled": tiled}
LAMPS = {5.0: 0.8, 20.0: 0.4, 80.0: 0.2}
"""Half the side of a lamp by its radiance: all light the room alike."""
WARM = Lamp(0.2, -1.4, 0.4, (30.0, 20.0, 8.0))


@cache
def lamp_room(walls: str, *lamps: Lamp, rows: int = 64) -> Frame:
    return room(ROOMS[walls], lamps, rows=rows)


def lamp(radiance: float) -> Lamp:
    return Lamp(0.2, -1.4, LAMPS[radiance], (radiance,) * 3)


def clip(frame: Frame, white: float = 1.0) -> Frame:
    return replace(frame, color=np.minimum(frame.color, np.float32(white)))


def srgb(color: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.asarray(np.round(255.0 * srgb_encode(np.clip(color, 0.0, 1.0))), np.uint8)


def tone_mapped(color: NDArray[np.float32]) -> NDArray[np.float32]:
    """As cameras show what is brighter than 0.4, up to 16, within what is left of the scale."""
    start, most = 0.4, 16.0
    over, end = 3.0 * (color - start) / (1.0 - start), 3.0 * (most - start) / (1.0 - start)
    shown = start + (1.0 - start) * np.log1p(np.maximum(over, 0.0)) / np.log1p(end)
    return np.where(color < start, color, shown).astype(np.float32)


def bright(frame: Frame) -> NDArray[np.bool_]:
    return np.asarray(frame.color.max(axis=-1) > 1.0)
