"""Shadows on the floor and light that bounces there, against Monte Carlo in the true room."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.oracles.worlds import Sphere, cosine_about
from tests.rendering import render
from tests.trace.traced import (
    FLOOR,
    ROOM,
    settings,
)
from tests.variants import ESTIMATORS
from tests.worlds import Float, ball, ceiling_lamp, room_frame

DOWN = View(96, 72, pitch_deg=-35.0)

# As traced, without the spatial filter: what remains is noise, which averages out.
RAW: dict[str, Any] = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}


def floor_block(view: View, row: int, column: int, count: int) -> Float:
    """(count, 3) floor points that the 3 x 3 pixels about a pixel see, evenly over them."""
    block = View(
        3 * view.width, 3 * view.height, view.yaw_deg, view.pitch_deg, fov_y_deg=view.fov_y_deg
    )
    rows, columns = (slice(3 * at - 3, 3 * at + 6) for at in (row, column))
    d = np.resize(block.directions()[rows, columns].reshape(-1, 3), (count, 3))
    return np.asarray(d * (FLOOR / d[:, 1:2]))


def floor_light(
    points: Float, solid: Sphere, albedo: tuple[float, float, float]
) -> tuple[Float, Float]:
    """(3,) E_R / π and E_RV / π, means over (N, 3) floor points, by Monte Carlo in the true room.

    The ball is Lambertian and convex, so light reaches the floor by way of it in one bounce.
    """
    rng = np.random.default_rng(5)

    def room_light(o: Float, d: Float) -> Float:
        t, normal, _ = ROOM.first_hit(o, d)
        return ceiling_lamp(o + t[..., None] * d, normal)

    o = points + np.array([0.0, 1e-6, 0.0])
    d = cosine_about(np.broadcast_to([0.0, 1.0, 0.0], o.shape), rng)
    seen = room_light(o, d)
    enter, leave, normal, _ = solid.interval(o, d)
    met = np.isfinite(enter) & (leave > 0.0)
    both = seen.copy()
    on_ball = o[met] + enter[met, None] * d[met] + 1e-6 * normal[met]
    both[met] = np.array(albedo) * room_light(on_ball, cosine_about(normal[met], rng))
    return seen.mean(0), both.mean(0)


def floor_truth(
    view: View,
    row: NDArray[np.integer],
    column: NDArray[np.integer],
    solid: Sphere,
    albedo: tuple[float, float, float],
) -> tuple[Float, Float]:
    """(N, 3) E_R / π and E_RV / π of pixels, each over a 3 x 3 block."""
    blocks = [floor_block(view, *at, 150_000) for at in zip(row, column, strict=True)]
    real, mixed = zip(*(floor_light(block, solid, albedo) for block in blocks), strict=True)
    return np.array(real), np.array(mixed)


def means3(image: NDArray[np.floating]) -> Float:
    """3 x 3 means of the inner pixels."""
    h, w = image.shape[:2]
    nine = [image[y : h - 2 + y, x : w - 2 + x] for y in range(3) for x in range(3)]
    return np.asarray(np.mean(nine, axis=0), np.float64)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize(
    ("albedo", "filtered"),
    [((0.0, 0.0, 0.0), False), ((0.9, 0.5, 0.1), True)],
    ids=["black ball, raw", "red ball, filtered"],
)
def test_floor_below_a_ball_matches_monte_carlo(
    device: ComputeDevice, albedo: tuple[float, float, float], filtered: bool, estimator: str
) -> None:
    """Along a line through the shadow's middle: umbra, penumbra, and the light that bounces."""
    solid = Sphere((0.2, FLOOR + 0.45, -1.4), 0.3)
    objects = [ball(solid.centre, solid.radius, Material(albedo=albedo))]
    chosen = settings(rays=8, estimator=estimator, **({} if filtered else RAW))
    frame = room_frame(ROOM, 512, 256, ceiling_lamp)
    pictures = [
        render(device, frame, objects, DOWN, chosen.model_copy(update={"seed": seed}), frames=16)
        for seed in range(2)
    ]
    x = solid.centre[0] + np.array([-0.55, -0.4, -0.2, 0.0, 0.2, 0.4, 0.55, 0.9])
    line = np.stack([x, np.full_like(x, FLOOR), np.full_like(x, -1.4)], axis=-1)
    column, row = np.floor(DOWN.project(line)).astype(int).T
    real, mixed = floor_truth(DOWN, row, column, solid, albedo)

    def shown(name: str) -> Float:
        means = [means3(picture.aovs[name])[row - 1, column - 1] for picture in pictures]
        return np.asarray(np.mean(means, axis=0))

    tolerance = 0.09 if filtered else 0.06
    np.testing.assert_allclose(shown("irradiance_real"), real, rtol=0.06)
    np.testing.assert_allclose(shown("irradiance_mixed"), mixed, atol=tolerance * real.max())
    np.testing.assert_allclose(shown("ratio"), mixed / real, atol=tolerance)
    assert (mixed / real)[3].max() < 0.4  # the test has an umbra
    assert abs(shown("ratio")[-1] - 1.0).max() < 0.02
