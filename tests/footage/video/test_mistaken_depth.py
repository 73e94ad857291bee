"""Depth that is a picture by its values is refused, and depth of rooms is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.footage.video.depth_code import DepthCode
from iprt.footage.video.mistaken_depth import require_no_picture
from tests.scene.files import box_room

Picture = NDArray[np.float32]
PATH = Path("d.exr")
RNG = np.random.default_rng(5)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
UNKNOWN, INVERSE = DepthCode(), DepthCode(None, (0.5, 20.0), "inverse")


def tiles(rows: int, columns: int, size: int) -> Picture:
    """Random values from 0.05 to 1 that repeat over `size` texels: a texture."""
    few = RNG.uniform(0.05, 1.0, (rows // size, columns // size))
    return np.kron(few, np.ones((size, size))).astype(np.float32)


def room(height: int = 64) -> tuple[Picture, Picture, Picture]:
    """Depth in metres, light of a lamp at the camera, and a textured picture in it."""
    depth, normal = (picture.astype(np.float32) for picture in box_room(2 * height, height))
    lamp = np.abs(normal).max(axis=-1) / (depth * depth)
    texture = np.stack([tiles(height, 2 * height, 4) for _ in range(3)], axis=-1)
    return depth, lamp, texture * lamp[..., None]


@pytest.mark.parametrize(
    ("made", "code"),
    [
        (lambda light: light / light.max(), UNKNOWN),
        (lambda light: (light / light.max()) ** (1 / 2.4), UNKNOWN),
        (lambda light: light * 3.0, UNKNOWN),
        (lambda light: 5 * light / light.max(), DepthCode(5.0)),
        (lambda light: INVERSE.metres(light / light.max(), 0.0, 1.0), INVERSE),
        (lambda light: DepthCode(None, (9, 1)).metres(light, 0.0, 9.0), DepthCode(None, (9, 1))),
    ],
)
def test_a_grey_picture_is_no_depth_by_any_code(
    made: Callable[[Picture], Picture], code: DepthCode
) -> None:
    _, _, color = room()
    with pytest.raises(FormatError, match="holds no depth: its values rise and fall"):
        require_no_picture(PATH, made(color @ LUMINANCE), color, code)


@pytest.mark.parametrize("height", [16, 64, 400])
def test_ambient_occlusion_is_no_depth_where_it_is_what_shows(height: int) -> None:
    occlusion = tiles(height, 2 * height, 4)
    noise = RNG.normal(1.0, 0.1, occlusion.shape).astype(np.float32)
    color = np.repeat((3.0 * occlusion * noise)[..., None], 3, axis=-1)
    with pytest.raises(FormatError, match="ambient occlusion"):
        require_no_picture(PATH, occlusion, color, UNKNOWN)
    require_no_picture(PATH, 4.0 * occlusion, color, UNKNOWN)  # metres up to 4


@pytest.mark.parametrize("scale", [1.0, 0.1])
def test_depth_of_a_room_is_depth(scale: float) -> None:
    depth, lamp, color = room()
    near = depth * np.float32(scale)
    for picture in (color, np.full_like(color, 0.5), np.repeat(lamp[..., None], 3, axis=-1)):
        require_no_picture(PATH, near, picture, UNKNOWN)
        require_no_picture(PATH, near, picture, DepthCode(None, (0.1, 9.0)))
    require_no_picture(PATH, depth, color, INVERSE)


def test_too_little_to_tell_is_depth() -> None:
    depth = np.zeros((16, 32), np.float32)
    depth[0] = np.linspace(0.1, 1.0, 32)
    require_no_picture(PATH, depth, np.repeat(depth[..., None], 3, axis=-1), UNKNOWN)
    require_no_picture(PATH, np.full((16, 32), np.nan, np.float32), np.ones((16, 32, 3)), UNKNOWN)
