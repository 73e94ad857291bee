"""What objects change in the light of real surfaces: closed forms, Monte Carlo, no bit more."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import minimum_filter
from scipy.stats import norm

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.oracles.worlds import Box, Solid, Sphere, World, cosine_about
from tests.trace.change import DOWN, RED, ROOM, SCENES, SURE, absolute, agree, blocks, change_of
from tests.worlds import Float, ball, ceiling_lamp, panorama_at, room_frame, sphere_frame

pytestmark = pytest.mark.gl

WHITE = Material(albedo=(1.0, 1.0, 1.0))
BIAS = 1e-3
"""Metres above a surface from which objects are looked for, in a room."""


def surface_points(world: World, view: View) -> tuple[Float, Float]:
    """(H, W, 3) what pixels' centres see, and normals there."""
    d = view.directions()
    distance, normal, _ = world.first_hit(np.zeros(3), d)
    return distance[..., None] * d, normal


# A furnace -----------------------------------------------------------------------------------


@pytest.mark.parametrize("light_sampling", [False, True])
def test_a_white_ball_in_a_furnace_changes_nothing(
    device: ComputeDevice, light_sampling: bool
) -> None:
    """It sends back what it hides."""
    frame = sphere_frame(2.0, 128, 64, 0.7)
    objects = [ball((0.3, -0.2, -0.9), 0.35, WHITE)]
    blocked, bounce, _, ratio = change_of(
        device, frame, objects, View(48, 36, yaw_deg=60.0), light_sampling=light_sampling
    )
    assert blocked.max() > 0.02
    np.testing.assert_allclose(bounce, blocked, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(ratio, 1.0, atol=1e-4)


# Monte Carlo ---------------------------------------------------------------------------------


def truth(
    frame: Frame, solid: Solid, albedo: Float, view: View, side: int = 6, count: int = 30_000
) -> tuple[Float, Float, Float]:
    """(N, 2, 3) blocked and bounced irradiance / π of squares of pixels, errors, usable (N,).

    Float64, in the true room with the panorama's radiance, whose rays start as far above the floor
    as ours. Squares that show a wall or the solid are not usable.
    """
    rng = np.random.default_rng(7)
    lift = 2.0 * np.pi / frame.height
    means, errors, usable = [], [], []
    d = view.directions()
    point, normal = surface_points(ROOM, view)
    plain = (normal[..., 1] > 0.5) & ~np.isfinite(solid.interval(np.zeros_like(d), d)[0])
    for y in range(0, view.height // side * side, side):
        for x in range(0, view.width // side * side, side):
            square = (slice(y, y + side), slice(x, x + side))
            usable.append(plain[square].all())
            if not usable[-1]:
                means.append(np.zeros((2, 3)))
                errors.append(np.ones((2, 3)))
                continue
            p = np.resize(point[square].reshape(-1, 3), (count, 3))
            up = np.tile([0.0, 1.0, 0.0], (count, 1))
            w = cosine_about(up, rng)
            from_real = p + lift * np.linalg.norm(p, axis=1, keepdims=True) * up
            from_object = p + BIAS * up

            def light(o: Float, along: Float) -> Float:
                reach = ROOM.first_hit(o, along)[0]
                return panorama_at(frame.color, o + reach[:, None] * along)

            enter, _, facing, _ = solid.interval(from_object, w)
            met = np.isfinite(enter) & (enter > 0.0)
            hidden, sent = np.zeros((2, count, 3))
            hidden[met] = light(from_real[met], w[met])
            at = from_object[met] + enter[met, None] * w[met]
            out = cosine_about(facing[met], rng)
            sent[met] = albedo * light(at, out)
            means.append(np.stack([hidden.mean(0), sent.mean(0)]))
            errors.append(np.stack([hidden.std(0), sent.std(0)]) / np.sqrt(count))
    return np.array(means), np.array(errors), np.array(usable)


@pytest.mark.parametrize("light_sampling", [False, True], ids=["even", "aimed"])
@pytest.mark.parametrize("name", SCENES)
def test_light_blocked_and_bounced_is_monte_carlos(
    device: ComputeDevice, name: str, light_sampling: bool
) -> None:
    solid, objects, material = SCENES[name]
    frame = room_frame(ROOM, 256, 128, ceiling_lamp)
    wanted, error, usable = truth(frame, solid, np.array(material.albedo), DOWN)
    assert usable.sum() > 15
    found = absolute(device, frame, objects, 6, rays=8, light_sampling=light_sampling)
    for part, channel in ((0, 0), *(((1, 0), (1, 2)) if material is RED else ())):
        exact = wanted[usable, part, channel]
        slack = 3.0 * error[usable, part, channel] + 0.01 * exact + 0.002 * exact.max()
        agree(found[:, usable, part, channel], exact, slack)
        assert exact.max() > 10.0 * slack.min()


@pytest.mark.thorough
def test_both_estimators_find_the_same(device: ComputeDevice) -> None:
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = SCENES["ball"][1]
    found = {
        name: np.array(
            [
                blocks(change_of(device, frame, objects, DOWN, seed=seed, irradiance=SURE, rays=16,
                                 frames=4, estimator=name)[3][..., 0])
                for seed in range(5)
            ]
        )
        for name in ("delta", "ratio")
    }  # fmt: skip
    delta, ratio = found["delta"], found["ratio"]
    assert ratio.mean(0).min() < 0.7
    error = np.sqrt((delta.var(0, ddof=1) + ratio.var(0, ddof=1)) / len(delta))
    threshold = norm.isf(0.5 * (1.0 - 0.99 ** (1.0 / delta.shape[1])))
    apart = np.abs(delta.mean(0) - ratio.mean(0))
    assert (apart < 1.5 * threshold * error + 0.02).all()


# Bits ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("filtered", [False, True], ids=["raw", "filtered"])
def test_nothing_changes_where_all_objects_are_below_the_horizon(
    device: ComputeDevice, filtered: bool
) -> None:
    hidden = World(solids=(Box((-0.2, -0.2, -1.3), (1.5, 1.0, 0.1)),))
    behind = Sphere((1.9, -1.1, -1.5), 0.15)
    view = View(48, 36, yaw_deg=25.0, pitch_deg=-4.0)
    frame = room_frame(hidden, 128, 64, ceiling_lamp)
    objects = [ball(behind.centre, behind.radius, RED)]
    blocked, bounce, _, ratio = change_of(device, frame, objects, view, filtered=filtered)
    point, normal = surface_points(hidden, view)
    # The whole box around the ball, and what the filter reaches.
    height = (np.asarray(behind.centre) - point) * normal
    reach = np.abs(normal).sum(-1) * behind.radius * 1.05
    below = height.sum(-1) + reach < 0.0
    assert below.mean() > 0.3
    for planes in (blocked, bounce):
        assert not planes[below].any()
        assert planes.max() > 0.0
    # Pixels on a depth edge show both surfaces.
    assert (ratio[minimum_filter(below, 5)] == 1.0).all()


def test_two_runs_are_equal(device: ComputeDevice) -> None:
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    first, again = (
        change_of(device, frame, SCENES["ball"][1], DOWN, filtered=True) for _ in range(2)
    )
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
