"""Noise of pictures whose error is known, and when a goal is met."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.convergence import Convergence, Goal
from iprt.output.display import display

EXPOSURE = 1.5
SIGMA, MEAN = 0.02, 0.3


def means(count: int, mean: float = MEAN, sigma: float = SIGMA) -> list[np.ndarray]:
    """Means of 1, 2, ... frames with independent errors."""
    random = np.random.default_rng(1)
    frames = mean + sigma * random.standard_normal((count, 64, 64, 3))
    total = np.cumsum(frames, axis=0)
    return [(total[i] / (i + 1)).astype(np.float32) for i in range(count)]


def test_noise_is_the_error_of_the_displayed_mean() -> None:
    """Within the accuracy of few pixels, after doublings and between them."""
    convergence = Convergence(EXPOSURE)
    truth = display(np.full((64, 64, 3), MEAN), EXPOSURE)
    for count, picture in enumerate(means(64), start=1):
        noise = convergence.add(count, picture)
        assert (noise is None) == (count == 1)
        if noise is not None:
            error = np.sqrt(np.mean((display(picture, EXPOSURE) - truth) ** 2))
            assert noise == pytest.approx(error, rel=0.1)
    assert convergence.add(1, picture) is None


def test_what_is_beyond_white_is_no_noise() -> None:
    convergence = Convergence(1.0)
    for count, picture in enumerate(means(8, mean=100.0, sigma=10.0), start=1):
        noise = convergence.add(count, picture)
    assert noise == 0.0


def test_pixels_that_stay_count_for_nothing() -> None:
    alone, among = Convergence(EXPOSURE), Convergence(EXPOSURE)
    for count, picture in enumerate(means(4), start=1):
        wide = np.concatenate([picture, np.full((64, 500, 3), 0.2, np.float32)], axis=1)
        assert alone.add(count, picture) == among.add(count, wide)


def visited(goal: Goal, pictures: list[np.ndarray]) -> list[int]:
    """Numbers of frames at which a goal looks at the picture."""
    found = []
    while goal.next_frames > goal.frames:
        found.append(goal.next_frames)
        goal.add(found[-1], pictures[found[-1] - 1])
    return found


def test_a_goal_is_met_when_the_error_is_as_small() -> None:
    pictures = means(512)
    goal = Goal(0.002, 512, EXPOSURE)
    assert visited(goal, pictures) == [2**i for i in range(goal.frames.bit_length())]
    assert goal.met
    truth = display(np.full((64, 64, 3), MEAN), EXPOSURE)

    def error(frames: int) -> float:
        return float(np.sqrt(np.mean((display(pictures[frames - 1], EXPOSURE) - truth) ** 2)))

    assert goal.reached == pytest.approx(error(goal.frames), rel=0.1)
    assert error(goal.frames) < 0.0021
    assert error(goal.frames // 2) > 0.0019


@pytest.mark.parametrize("most", [1, 2, 20])
def test_a_goal_ends_at_the_most_frames(most: int) -> None:
    goal = Goal(1e-5, most, EXPOSURE)
    assert visited(goal, means(most))[-1] == most
    assert goal.frames == most
    assert not goal.met
    assert (goal.reached is None) == (most == 1)


def test_a_picture_without_noise_ends_at_once() -> None:
    goal = Goal(0.001, 100, EXPOSURE)
    assert visited(goal, [np.full((2, 2, 3), 0.5, np.float32)] * 100) == [1, 2]
    assert goal.met
