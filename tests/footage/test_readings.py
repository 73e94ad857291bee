"""The reading of depth follows from the planes of places, and from nothing else."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.readings import Reading, likely_reading
from tests.scene.files import box_room, directions

Depth = NDArray[np.float32]
READINGS: tuple[Reading, ...] = get_args(Reading)


def as_read(depth: NDArray[np.floating], reading: Reading) -> Depth:
    """Return distances as written by another reading, by the definition of each."""
    height, width = depth.shape
    x, y, z = np.abs(np.moveaxis(directions(width, height), -1, 0))
    face = np.maximum(np.maximum(x, y), z)
    with np.errstate(divide="ignore"):
        written = {
            "distance": depth,
            "inverse": 1.0 / depth,
            "cube": depth * face,
            "axis": depth * z,
            "twice": depth / face,
        }[reading]
    return written.astype(np.float32)


def box(x: float, y: float, z: float, height: int = 128) -> NDArray[np.float64]:
    """Return distances in a box of these half sides."""
    w = np.abs(directions(2 * height, height))
    return (np.array([x, y, z]) / np.maximum(w, 1e-12)).min(axis=-1)


def ground(height: int = 128) -> NDArray[np.float64]:
    up = directions(2 * height, height)[..., 1]
    return np.where(up < -0.02, -1.5 / np.minimum(up, -0.02), 0.0)


PLACES = {
    "room": box_room(256, 128)[0],
    "small": box_room(96, 48)[0],
    "corridor": box(1.0, 1.5, 10.0),
    "hall": box(20.0, 3.0, 15.0),
    "cellar": box(2.0, 1.2, 2.0),
    "ground": ground(),
}


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("place", PLACES)
def test_places_of_planes(place: str, reading: Reading) -> None:
    written = as_read(PLACES[place], reading)
    assert likely_reading(written, is_cube=reading == "twice") == reading


@pytest.mark.parametrize("reading", ["distance", "cube"])
@pytest.mark.parametrize("noise", [0.003, 0.01, 0.03])
def test_noise_does_not_hide_it(noise: float, reading: Reading) -> None:
    rng = np.random.default_rng(1)
    depth = PLACES["room"]
    noisy = depth * (1.0 + rng.normal(0.0, noise, depth.shape))
    assert likely_reading(as_read(noisy, reading)) == reading


def test_what_has_no_planes_is_distance() -> None:
    w = directions(256, 128)
    rng = np.random.default_rng(2)
    up = w[..., 1]
    cylinder = np.minimum(3.0 / np.sqrt(1.0 - up**2), 1.5 / np.maximum(np.abs(up), 1e-9))
    dome = np.where(up > -0.015, 100.0, -1.5 / np.minimum(up, -0.015))
    for depth in (
        np.full(up.shape, 3.0),
        3.0 + 0.1 * w[..., 0],
        2.0 + w[..., 0],
        cylinder,
        dome,
        np.exp(rng.normal(0.0, 1.0, up.shape)),
        np.zeros(up.shape),
        np.where(np.abs(up) > 0.997, 3.0, 0.0),
        np.full((2, 4), 3.0),
        np.full(up.shape, np.nan),
    ):
        assert likely_reading(depth.astype(np.float32)) == "distance"
        assert likely_reading(depth.astype(np.float32), is_cube=True) == "distance"
