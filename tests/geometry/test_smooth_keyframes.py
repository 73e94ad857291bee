"""Smooth keyframes, against curves whose formulas are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.geometry.camera import View
from iprt.geometry.keyframes import ObjectKeyframe, ObjectMotion, ViewKeyframe, ViewMotion
from iprt.geometry.smooth_motion import Interpolation

Float = NDArray[np.float64]
UNEVEN = (0.0, 0.5, 1.25, 2.0, 3.0, 3.25)


def moving(
    points: Sequence[Float], times: Sequence[float] = UNEVEN, how: Sequence[Interpolation] = ()
) -> Callable[[float], Float]:
    how = how or ["smooth"] * len(times)
    keys = [
        ObjectKeyframe(time=t, translation=[float(x) for x in p], interpolation=h)
        for t, p, h in zip(times, points, how, strict=True)
    ]
    motion = ObjectMotion.of(np.eye(4), keys)
    return lambda time: motion.at(time)[:3, 3]


def turning(quaternions: Float, times: Sequence[float] = UNEVEN) -> Callable[[float], Rotation]:
    keys = [
        ObjectKeyframe(time=t, rotation=q.tolist(), interpolation="smooth")
        for t, q in zip(times, quaternions, strict=True)
    ]
    motion = ObjectMotion.of(np.eye(4), keys)
    return lambda time: Rotation.from_matrix(motion.at(time)[:3, :3])


def rate(at: Callable[[float], Float], time: float, side: int) -> Float:
    """One-sided derivative, exact for cubic curves up to rounding."""
    h = side * 1e-4
    return (-11 * at(time) + 18 * at(time + h) - 9 * at(time + 2 * h) + 2 * at(time + 3 * h)) / (
        6 * h
    )


def test_curves_pass_through_keys_without_corners() -> None:
    """At the ends too, beyond which nothing moves."""
    points = np.random.default_rng(1).normal(size=(6, 3))
    at = moving(list(points))
    for time, point in zip(UNEVEN, points, strict=True):
        np.testing.assert_allclose(at(time), point, atol=1e-12)
        np.testing.assert_allclose(rate(at, time, -1), rate(at, time, 1), atol=1e-6)
    np.testing.assert_allclose(rate(at, UNEVEN[0], 1), 0.0, atol=1e-6)


def test_a_parabola_is_exact_between_inner_keys() -> None:
    def parabola(time: float) -> Float:
        return np.array([time, 2.0 * time**2 - time, 1.0 - 0.5 * time**2])

    at = moving([parabola(time) for time in UNEVEN])
    for time in np.linspace(UNEVEN[1], UNEVEN[-2], 17):
        np.testing.assert_allclose(at(float(time)), parabola(time), atol=1e-9)


def test_straight_lines_stay_straight() -> None:
    """However unevenly their keys lie."""
    along = np.array([1.0, -2.0, 0.5])
    at = moving([share * along for share in (0.0, 0.1, 0.7, 0.75, 2.0, 2.5)])
    for time in np.linspace(0.0, 3.25, 40):
        np.testing.assert_allclose(np.cross(at(float(time)), along), 0.0, atol=1e-12)


def test_smooth_parts_meet_linear_and_held_ones() -> None:
    """Without a corner beside a linear part, and at rest beside a held one."""
    points = np.random.default_rng(2).normal(size=(6, 3))
    at = moving(list(points), how=["linear", "smooth", "smooth", "step", "smooth", "smooth"])
    np.testing.assert_allclose(at(0.2), 0.6 * points[0] + 0.4 * points[1], atol=1e-12)
    np.testing.assert_allclose(rate(at, 0.5, 1), (points[1] - points[0]) / 0.5, atol=1e-6)
    np.testing.assert_allclose(rate(at, 2.0, -1), 0.0, atol=1e-6)
    np.testing.assert_allclose(at(2.9), points[3], atol=1e-12)
    np.testing.assert_allclose(rate(at, 3.0, 1), 0.0, atol=1e-6)


def test_a_turn_about_one_axis_is_the_curve_of_its_angle() -> None:
    angles = np.array([0.0, 0.4, 1.9, 2.0, 4.0, 3.0])
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    turn = turning(Rotation.from_rotvec(angles[:, None] * axis).as_quat())
    angle = moving([np.array([value, 0.0, 0.0]) for value in angles])
    for time in np.linspace(0.0, 3.25, 40):
        expected = Rotation.from_rotvec(angle(float(time))[0] * axis)
        assert (turn(float(time)) * expected.inv()).magnitude() < 1e-9


def test_rotations_pass_through_keys_without_corners() -> None:
    quaternions = Rotation.random(6, rng=np.random.default_rng(3)).as_quat()
    turn = turning(quaternions)
    for time, quaternion in zip(UNEVEN, quaternions, strict=True):
        key = Rotation.from_quat(quaternion)
        assert (turn(time) * key.inv()).magnitude() < 1e-9

        def from_key(at: float, key: Rotation = key) -> Float:
            return (turn(at) * key.inv()).as_rotvec()

        np.testing.assert_allclose(rate(from_key, time, -1), rate(from_key, time, 1), atol=1e-4)


def test_opposite_quaternions_are_the_same_turn() -> None:
    """The shorter arc is taken."""
    quaternions = Rotation.from_euler("y", [[0.0], [120.0], [240.0]], degrees=True).as_quat()
    turn, times = turning(quaternions, (0.0, 1.0, 2.0)), np.linspace(0.0, 2.0, 21)
    other = turning(quaternions * [[1.0], [-1.0], [1.0]], (0.0, 1.0, 2.0))
    for time in times:
        assert (turn(float(time)) * other(float(time)).inv()).magnitude() < 1e-9
    steps = [(turn(b) * turn(a).inv()).magnitude() for a, b in pairwise(times.tolist())]
    assert np.rad2deg(sum(steps)) == pytest.approx(240.0)


def test_views_and_sizes_do_not_overshoot() -> None:
    """A pitch beyond 90 degrees, or a size below 0, would be none."""
    pitches = (80.0, 90.0, 90.0, 10.0, 10.0, -90.0)
    keys = [
        ViewKeyframe(time=t, pitch_deg=p, interpolation="smooth")
        for t, p in zip(UNEVEN, pitches, strict=True)
    ]
    motion = ViewMotion.of(View(32, 24), keys)
    found = [motion.at(float(time)).pitch_deg for time in np.linspace(0.0, 3.25, 131)]
    assert max(found) < 90.0 + 1e-9
    assert min(found) > -90.0 - 1e-9
    assert motion.at(0.8).pitch_deg == pytest.approx(90.0, abs=1e-9)
    sizes = [ObjectKeyframe(time=t, scale=s, interpolation="smooth") for t, s in SIZES]
    grown = ObjectMotion.of(np.eye(4), sizes)
    assert all(np.diag(grown.at(float(t)))[0] > 0.01 - 1e-9 for t in np.linspace(0, 3, 61))


SIZES = ((0.0, 5.0), (1.0, 0.01), (1.5, 0.01), (3.0, 5.0))
