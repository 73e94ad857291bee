"""Local linear models learned online: closed forms, the paper's equations, and promises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.world.real.panorama import Panorama
from iprt.world.real.radiance_models import PRIOR, WIDEST, Learner, Learning
from tests.oracles.learned import Model, predicted, tangents, weight_of
from tests.oracles.worlds import World
from tests.worlds import Float, bright_walls, pose_at, room_frame

HOW = Learning(0.2, forgetting=1.0, first_forgetting=1.0, rate=0.0, slopes_penalty=0.0)
"""Without forgetting, bandwidths that stay."""
MIDDLE = np.array([0.1, 0.1, 0.1])
"""Of a cell of the grid."""
NORMAL = np.array([0.36, 0.48, 0.8])
Field = Callable[[Float], Float]


def samples(points: Float, normals: Float, colors: Float) -> NDArray[np.float32]:
    """(N, 3, 4) as `Learner.draw` returns them, of texels that are small."""
    made = np.zeros((len(points), 3, 4), np.float32)
    made[:, 0, :3], made[:, 0, 3] = points, 0.002
    made[:, 1, :3], made[:, 1, 3] = normals, 1.0
    made[:, 2, :3] = colors
    return made


def patch(rng: np.random.Generator, count: int, size: float, field: Field) -> NDArray[np.float32]:
    """Samples of a square about `MIDDLE`, by a field of two coordinates (N, 2)."""
    across, up = tangents(NORMAL)
    at = rng.uniform(-0.5 * size, 0.5 * size, (count, 2))
    points = MIDDLE + at[:, :1] * across + at[:, 1:] * up
    return samples(points, np.broadcast_to(NORMAL, points.shape), field(at))


def waves(at: Float) -> Float:
    x, y = at.T
    return np.stack([1.0 + np.sin(30.0 * x), 1.0 + 4.0 * y * y, 0.5 + x * y], -1)


def linear(at: Float) -> Float:
    return np.asarray([1.0, 2.0, 0.5] + at @ np.array([[1.0, -0.5, 0.2], [0.3, 0.7, -0.1]]))


def taught(
    device: ComputeDevice, rounds: list[NDArray[np.float32]], how: Learning = HOW
) -> Learner:
    learner = Learner(device, max(map(len, rounds)), 4096)
    for part in rounds:
        learner.learn(part, how)
    return learner


def edge(at: Float) -> Float:
    """Beside the middle."""
    return np.where(at[:, :1] > 0.03, 2.0, 0.2) * [1.0, 0.8, 0.6] + at[:, 1:]


def ordered(rng: np.random.Generator, count: int, field: Field = waves) -> NDArray[np.float32]:
    """Draw samples in one cell, which are learned in order; the first is the model's centre."""
    made = patch(rng, count, 0.12, field)
    made[0, 0, :3] = MIDDLE
    return made


@pytest.mark.parametrize("forgetting", [1.0, 0.98])
def test_coefficients_are_those_of_weighted_ridge_regression(
    device: ComputeDevice, forgetting: float
) -> None:
    made = ordered(np.random.default_rng(1), 300)
    how = replace(HOW, forgetting=forgetting, first_forgetting=forgetting)
    (model,) = taught(device, [made[:1], made], how).models()
    learned = np.concatenate([made[:1], made]).astype(np.float64)
    d = learned[:, 0, :3] - MIDDLE
    x = np.stack([np.ones(len(d)), *(d @ t / how.radius for t in tangents(NORMAL))], -1)
    w = weight_of(d, WIDEST * how.radius) * forgetting ** np.arange(len(d))[::-1]
    ridge = PRIOR * forgetting ** len(d) * np.eye(3)
    wanted = np.linalg.solve(x.T @ (w[:, None] * x) + ridge, x.T @ (w[:, None] * learned[:, 2, :3]))
    np.testing.assert_allclose(model[2:5, :3], wanted, rtol=2e-3, atol=1e-3)
    assert model[1, 3] == len(d)


@pytest.mark.parametrize("slopes_penalty", [0.0, 0.1])
def test_models_follow_the_equations(device: ComputeDevice, slopes_penalty: float) -> None:
    """Eqs. 6, 7 and 8 with all that changes, on both sides of an edge."""
    rng = np.random.default_rng(2)
    rounds = [ordered(rng, 200, edge) for _ in range(3)]
    how = Learning(0.2, metre=0.9, unit=0.7, slopes_penalty=slopes_penalty)
    found = taught(device, [rounds[0][:1], *rounds], how).models()[0]
    model = Model(MIDDLE, NORMAL, how, WIDEST * how.radius)
    for sample in np.concatenate([rounds[0][:1], *rounds]).astype(np.float64):
        model.learn(sample[0, :3], sample[1, :3], sample[2, :3], sample[0, 3])
    assert 0.1 < model.bandwidth / (WIDEST * how.radius) < 0.9
    np.testing.assert_allclose(found[0, 3], model.bandwidth, rtol=1e-2)
    np.testing.assert_allclose(found[2:5, :3], model.beta, rtol=1e-2, atol=1e-2)
    np.testing.assert_allclose(found[2:4, 3], [model.weights, model.errors], rtol=2e-2)


def test_what_is_asked_is_the_weighted_mean_of_all_models_around(device: ComputeDevice) -> None:
    """Eq. 4 without a grid; cells below 0, and beyond the table, which repeats itself."""
    rng = np.random.default_rng(5)
    for away in (np.zeros(3), np.array([-7.3, 2.9, 41.7])):
        rounds = [patch(rng, 2000, 1.0, waves) for _ in range(4)]
        for part in rounds:
            part[:, 0, :3] += away.astype(np.float32)
        learner = taught(device, rounds, Learning(0.2))
        asked = patch(rng, 500, 1.5, waves)
        asked[:, 0, :3] += away.astype(np.float32)
        asked[::3, 1, :3] = np.array([0.6, 0.0, 0.8])
        asked[1::3, 1, :3] *= -1.0
        radiance, known = learner.ask(asked)
        points, normals = (asked[:, part, :3].astype(np.float64) for part in (0, 1))
        wanted, weight = predicted(learner.models(), points, normals, 0.2)
        beyond = np.abs(weight - 0.1) < 1e-4
        np.testing.assert_array_equal(known[~beyond], (weight > 0.0)[~beyond])
        assert 50 < known.sum() < 400
        close = np.isclose(radiance, wanted, rtol=1e-3, atol=1e-3).all(axis=1)
        assert close.mean() > 0.99


def test_models_cover_all_samples_once(device: ComputeDevice) -> None:
    """Each is created where the ones before have too little weight (section IV-A)."""
    rng = np.random.default_rng(7)
    made = patch(rng, 3000, 1.5, linear)
    learner = taught(device, [made])
    models = learner.models().astype(np.float64)
    centre = models[:, 0, :3]
    apart = np.linalg.norm(centre[:, None] - centre, axis=-1) + 1e3 * np.eye(len(centre))
    assert apart.min() > 0.2 * 0.999
    to_models = np.linalg.norm(made[:, None, 0, :3] - centre, axis=-1).min(axis=1)
    assert to_models.max() <= 0.2 * 1.001


def test_sides_of_a_thin_wall_do_not_mix(device: ComputeDevice) -> None:
    rng = np.random.default_rng(9)
    front = patch(rng, 800, 0.5, lambda at: np.ones((len(at), 3)))
    back = patch(rng, 800, 0.5, lambda at: np.full((len(at), 3), 5.0))
    back[:, 0, :3] -= np.float32(0.01) * NORMAL.astype(np.float32)
    back[:, 1, :3] *= -1.0
    learner = taught(device, [np.concatenate([front, back])] * 2)
    for side, wanted in ((front, 1.0), (back, 5.0)):
        radiance, known = learner.ask(side)
        np.testing.assert_allclose(radiance[known], wanted, atol=1e-2)
        assert known.mean() > 0.9


def test_nothing_and_no_numbers_are_harmless(device: ComputeDevice) -> None:
    rng = np.random.default_rng(10)
    asked = patch(rng, 100, 0.3, linear)
    learner = Learner(device, 512, 64)
    assert not learner.ask(asked)[1].any()
    assert not learner.ask(asked)[0].any()
    learner.learn(asked[:0], HOW)
    bad = patch(rng, 400, 0.3, linear)
    for i, value in enumerate((np.nan, np.inf, -np.inf)):
        bad[i::40, i] = value
    bad[3::40, 1, 3] = 0.0
    bad[3::40, 2] = 1e30
    for _ in range(3):
        learner.learn(bad, HOW)
    radiance, _ = learner.ask(asked)
    good = np.isfinite(learner.models()).all()
    assert good
    np.testing.assert_allclose(radiance, asked[:, 2, :3], atol=0.05)
    bad[:, 1, 3] = 0.0
    learner.learn(bad, HOW)
    assert not learner.ask(np.full_like(asked, np.nan))[1].any()


def test_there_are_no_more_models_than_may_be(device: ComputeDevice) -> None:
    rng = np.random.default_rng(11)
    learner = Learner(device, 2000, 8)
    for _ in range(3):
        learner.learn(patch(rng, 2000, 2.0, linear), HOW)
    assert learner.count == 8


def test_samples_are_the_surfaces_of_the_panorama(device: ComputeDevice) -> None:
    """On the walls of a room, evenly over the sphere, in the axes of the world; no windows."""
    world, pose = World(), pose_at((0.4, -0.2, 0.3), 25.0)
    frame = room_frame(world, 128, 64, bright_walls)
    opening = np.zeros((64, 128), bool)
    opening[20:30, 40:60] = True
    color = frame.color.copy()
    color[50, 10] = np.nan
    panorama = Panorama(device, 128, 64)
    panorama.load(replace(frame, opening=opening))
    device.write(panorama.radiance, color)
    learner = Learner(device, 4096, 64)
    learner.place(pose)
    drawn = learner.draw(panorama.surfaces, panorama.radiated)()[0].astype(np.float64)
    valid = drawn[:, 1, 3] > 0.0
    local = (drawn[:, 0, :3] - pose[:3, 3]) @ pose[:3, :3]
    normal = drawn[:, 1, :3] @ pose[:3, :3]
    distance = np.linalg.norm(local, axis=1)
    share = np.sin((np.arange(64) + 0.5) * np.pi / 64)
    window = (share[20:30].sum() * 20) / (share.sum() * 128)
    assert 1.0 - valid.mean() == pytest.approx(window, abs=0.003)
    on_wall = np.minimum(np.abs(local - world.low), np.abs(local - world.high)).min(axis=1)
    assert np.quantile(on_wall[valid], 0.95) < 0.01
    inside = np.isclose(np.abs(normal).max(axis=1), 1.0, atol=1e-3) & valid
    assert inside[valid].mean() > 0.9
    wanted = bright_walls(local[inside], normal[inside])
    np.testing.assert_allclose(drawn[inside, 2, :3], wanted, atol=0.03)
    np.testing.assert_allclose(drawn[valid, 0, 3], distance[valid] * np.pi / 64, rtol=1e-4)
    up = np.histogram(local[valid, 1] / distance[valid], 8, (-1.0, 1.0))[0]
    assert up.min() > 0.6 * up.max()
    again, _ = learner.draw(panorama.surfaces, panorama.radiated)()
    assert not np.array_equal(again, drawn.astype(np.float32))
