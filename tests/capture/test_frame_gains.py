"""Gains of frames are found in spite of texture, gloss, vignetting and noise; few are left out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from iprt.capture.frame_gains import Exposures, match_exposures
from iprt.capture.overlap import Glance
from iprt.capture.pinhole import Pinhole
from tests.capture.sequences import WALLS, Array, Camera, Trace, looking_around, noisy, room

CAMERA = Camera(96, 72, 66.0)
PINHOLE = Pinhole(66.0, 66.0, 47.5, 35.5, 96, 72)
POSES = looking_around(12, (0.0, 35.0))
LAMP = np.array([0.5, 1.2, 0.3])
DRIFT = 2.0 ** (0.8 * np.sin(np.arange(len(POSES)) / 2.0))[:, None] * [1.0, 0.95, 0.9]
"""Exposure goes up and down by 0.8 stops, and white balance with it."""

Change = Callable[[int, Array], Array]


def textured(origin: Array, direction: Array) -> tuple[Array, Array]:
    """Trace the room with checks of centimetres: no pixel is as bright as its neighbours."""
    color, t = room(origin, direction)
    point = origin + t[..., None] * direction
    checks = [[60.0, 37.0, 51.0], [-41.0, 66.0, 29.0], [23.0, -55.0, 71.0]]
    sign = np.prod([np.sign(np.sin(point @ waves)) for waves in checks], axis=0)
    return color * (0.7 + 0.4 * sign)[..., None], t


def glossy(origin: Array, direction: Array) -> tuple[Array, Array]:
    """Trace the room with highlights of a lamp, in another place for each camera."""
    color, t = textured(origin, direction)
    point = origin + t[..., None] * direction
    wall = np.argmax(np.abs(point) / WALLS, axis=-1)[..., None]
    mirrored = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    np.put_along_axis(mirrored, wall, -np.take_along_axis(mirrored, wall, -1), -1)
    lamp = LAMP - point
    lamp /= np.linalg.norm(lamp, axis=-1, keepdims=True)
    lobe = np.maximum((mirrored * lamp).sum(axis=-1), 0.0) ** 20
    return color + 0.8 * lobe[..., None], t


def corners_darker(share: float) -> Change:
    rays = CAMERA.rays()
    square = (rays[..., :2] ** 2).sum(axis=-1)
    fall = (1.0 - share * square / square.max())[..., None]
    return lambda _, color: color * fall


def matched(
    trace: Trace, change: Change = lambda _, color: color, jitter_m: float = 0.0
) -> Exposures:
    """Match exposures of a drifting sequence; `jitter_m` moves the cameras from their poses."""
    random = np.random.default_rng(2)
    glances = []
    for number, pose in enumerate(POSES):
        moved = pose[:3, 3] + random.normal(0.0, jitter_m, 3)
        color, depth = trace(moved, CAMERA.rays() @ pose[:3, :3].T)
        color = change(number, color) * DRIFT[number]
        color = np.maximum(color + random.normal(0.0, 0.01, color.shape), 0.0)
        glances.append(
            Glance.of(
                noisy(depth, random).astype(np.float32),
                color.astype(np.float32),
                color.max(axis=-1) > 4.0,
                PINHOLE,
            )
        )
    return match_exposures(glances, np.stack(POSES))


def worst(exposures: Exposures, without: tuple[int, ...] = ()) -> float:
    """Return the largest relative error of a gain, relative to the median error."""
    error = np.log(exposures.gain * DRIFT)
    kept = [number for number in range(len(POSES)) if number not in without]
    return float(np.abs(error - np.median(error[kept], axis=0))[kept].max())


@pytest.mark.parametrize(
    ("trace", "change", "jitter_m", "most"),
    [
        (room, lambda _, color: color, 0.0, 0.02),
        (textured, lambda _, color: color, 0.0, 0.1),
        (textured, lambda _, color: color, 0.02, 0.1),
        (glossy, lambda _, color: color, 0.01, 0.15),
        (room, corners_darker(0.5), 0.0, 0.03),
        (glossy, corners_darker(0.4), 0.01, 0.15),
    ],
    ids=["smooth", "textured", "jitter", "glossy", "vignette", "all"],
)
def test_good_frames_are_kept_and_their_gains_found(
    trace: Trace, change: Change, jitter_m: float, most: float
) -> None:
    exposures = matched(trace, change, jitter_m)
    assert not exposures.left_out
    assert exposures.trusted
    assert worst(exposures) < most


def test_vignetting_is_taken_away() -> None:
    exposures = matched(room, corners_darker(0.5))
    flat = exposures.matched(0, np.ones((72, 96, 3), np.float32), PINHOLE)
    np.testing.assert_allclose(corners_darker(0.5)(0, flat) / exposures.gain[0], 1.0, atol=0.03)


def test_only_the_frames_whose_colors_are_wrong_are_left_out() -> None:
    random = np.random.default_rng(3)

    def change(number: int, color: Array) -> Array:
        if number == 5:
            return random.uniform(0.0, 1.0, color.shape)
        if number == 9:  # a flash, brighter to one side
            return color * np.linspace(0.15, 3.0, color.shape[1])[:, None]
        return color * 0.001 if number == 0 else color  # the lens is covered

    exposures = matched(room, change)
    assert exposures.left_out == {0, 5, 9}
    assert worst(exposures, (0, 5, 9)) < 0.02


def test_where_most_do_not_match_all_are_taken_as_they_are() -> None:
    random = np.random.default_rng(3)

    def change(number: int, color: Array) -> Array:
        return (
            color
            if number % 3 == 0
            else random.uniform(0.0, 1.0, (3, 3, 3)).repeat(24, 0).repeat(32, 1)
        )

    exposures = matched(room, change)
    assert not exposures.trusted
    assert not exposures.left_out
    assert (exposures.gain == 1.0).all()
    color = np.full((72, 96, 3), 0.3, np.float32)
    np.testing.assert_array_equal(exposures.matched(4, color, PINHOLE), color)
