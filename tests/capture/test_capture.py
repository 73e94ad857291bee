"""Sequences of an analytic room: the panorama at a point is the one that the room shows there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.capture.panorama import BETWEEN, MEASURED, UNSEEN, Captured, capture_panorama
from iprt.capture.rgbd_sequence import RgbdSequence
from iprt.geometry.camera import View
from tests.capture.sequences import (
    Array,
    Camera,
    Trace,
    looking_around,
    noisy,
    room,
    with_ball,
    write_tum,
)

WIDTH = 128
CAMERA = Camera(80, 60, 55.0)
AROUND = [*looking_around(10, (0.0, 45.0, -45.0)), *looking_around(3, (85.0, -85.0))]
ORIGIN = np.zeros(3)


def captured(
    folder: Path,
    poses: list[Array],
    scenes: Trace | list[Trace] = room,
    exposure: Array | None = None,
    center: Array = ORIGIN,
    **options: bool,
) -> Captured:
    """A panorama of noisy pictures; `exposure` (frames, 3) scales their colors."""
    random = np.random.default_rng(5)

    def shoot(number: int, origin: Array, rays: Array) -> tuple[Array, Array]:
        trace = scenes[number] if isinstance(scenes, list) else scenes
        color, depth = trace(origin, rays)
        return color if exposure is None else color * exposure[number], noisy(depth, random)

    sequence = RgbdSequence.open(write_tum(folder, CAMERA, poses, shoot))
    return capture_panorama(sequence, width=WIDTH, center=center, **options)


def expected(center: Array = ORIGIN, trace: Trace = room) -> tuple[Array, Array]:
    return trace(center, View(WIDTH, WIDTH // 2, projection="equirect").directions())


@pytest.mark.thorough
def test_the_room_at_any_point(tmp_path: Path) -> None:
    center = np.array([0.5, -0.3, 0.4])
    result = captured(tmp_path / "s", AROUND, center=center)
    color, depth = expected(center)
    measured = result.seen == MEASURED
    assert measured.mean() > 0.97
    assert result.left_out == 0
    assert np.quantile(np.abs(result.depth - depth)[measured], 0.9) < 0.01
    assert np.sqrt(np.mean(np.square(result.color - color)[measured])) < 0.015
    assert result.removed < 0.001 * result.samples


def test_what_was_never_seen_is_marked(tmp_path: Path) -> None:
    result = captured(tmp_path / "s", looking_around(10, (0.0,)))
    rows = (np.arange(WIDTH // 2) + 0.5) / (WIDTH // 2) * 180.0 - 90.0
    assert (result.seen[np.abs(rows) > 60.0] == UNSEEN).all()
    assert (result.seen[np.abs(rows) < 15.0] != UNSEEN).all()
    assert not result.depth[result.seen == UNSEEN].any()
    assert (result.depth[result.seen != UNSEEN] > 0.0).all()
    assert set(np.unique(result.seen)) <= {UNSEEN, BETWEEN, MEASURED}
    assert result.color[result.seen == UNSEEN].min() > 0.05  # made up from around
    assert 0.4 < result.seen_share < 0.8


@pytest.mark.thorough
def test_a_thing_that_went_away_is_removed(tmp_path: Path) -> None:
    ball = with_ball(np.array([0.3, -0.2, -1.2]), 0.3)
    once = looking_around(10, (0.0,))
    # Depth is missing in places: to be sure of what is gone, the camera looks twice.
    poses = [*once, *once, *once]
    stays = captured(tmp_path / "a", poses, ball)
    goes = captured(tmp_path / "b", poses, [ball] * len(once) + 2 * [room] * len(once))
    _, empty = expected()
    _, full = expected(trace=ball)
    there = (full < empty - 0.5) & (stays.seen == MEASURED) & (goes.seen == MEASURED)
    assert there.sum() > 50
    assert np.quantile(np.abs(stays.depth - full)[there], 0.8) < 0.05
    assert np.quantile(np.abs(goes.depth - empty)[there], 0.95) < 0.1
    assert goes.removed > 20 * max(stays.removed, 1)


@pytest.mark.thorough
def test_exposure_and_white_balance_are_compensated(tmp_path: Path) -> None:
    number = np.arange(len(AROUND))
    exposure = 1.0 + np.sin(number / 3.0)[:, None] * [0.3, 0.25, 0.15]
    color, _ = expected()
    errors = {}
    for compensate in (True, False):
        result = captured(
            tmp_path / f"{compensate}", AROUND, exposure=exposure, compensate=compensate
        )
        measured = result.seen == MEASURED
        assert measured.mean() > 0.95
        errors[compensate] = np.sqrt(np.mean(np.square(result.color - color)[measured]))
    assert errors[True] < 0.02
    assert errors[False] > 3.0 * errors[True]


def test_frames_that_share_nothing_with_others_are_used(tmp_path: Path) -> None:
    poses = looking_around(4, (0.0,))
    result = captured(tmp_path / "s", [poses[0], poses[2]])  # 72 degrees each, opposite
    assert result.left_out == 0
    assert result.matched
    color, _ = expected()
    middle = np.s_[24:40]
    for columns in (np.s_[54:74], np.r_[0:10, 118:128]):
        measured = (result.seen == MEASURED)[middle, columns]
        assert measured.mean() > 0.9
        off = np.abs(result.color - color)[middle, columns][measured]
        assert np.quantile(off, 0.9) < 0.03
