"""Values between key times, poses and vertices: what closed forms and Hermite's formula say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.geometry.animation import Node, Skeleton, Skin, Track, moved, transform

SETTINGS = settings(max_examples=100, derandomize=True)
Float = NDArray[np.float64]

numbers = st.floats(-1e6, 1e6)
vectors = st.lists(numbers, min_size=3, max_size=3).map(np.array)
parts = st.floats(0.0, 1.0)
quaternions = (
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)


def track(
    times: list[float], values: object, *, held: bool = False, rotation: bool = False
) -> Track:
    return Track(
        np.array(times, np.float64),
        np.array(values, np.float64),
        np.full(len(times), held),
        rotation,
    )


def angle(a: Float, b: Float) -> float:
    """The turn from one orientation to the other, in radians, the short way."""
    return float((Rotation.from_quat(a).inv() * Rotation.from_quat(b)).magnitude())


@SETTINGS
@given(start=quaternions, end=quaternions, part=parts, begin=numbers, duration=st.floats(0.01, 1e3))
def test_turns_have_constant_speed(
    start: Float, end: Float, part: float, begin: float, duration: float
) -> None:
    """The angle from the start grows with time, along one way, which is the short one."""
    turn = track([begin, begin + duration], [start, end], rotation=True)
    time = begin + part * duration
    part = (time - begin) / ((begin + duration) - begin)  # as it was rounded
    now, whole = turn.at(time), angle(start, end)
    assert np.linalg.norm(now) == pytest.approx(1.0)
    assert angle(start, now) == pytest.approx(part * whole, abs=1e-6)
    assert angle(now, end) == pytest.approx((1.0 - part) * whole, abs=1e-6)


@SETTINGS
@given(values=st.lists(vectors, min_size=1, max_size=5), turn=st.lists(quaternions, min_size=5))
def test_keys_are_exact_and_hold_beyond(values: list[Float], turn: list[Float]) -> None:
    times = [0.1 * 2.0**n for n in range(len(values))]
    for held in (False, True):
        for keyed in (
            track(times, values, held=held),
            track(times, turn[: len(times)], rotation=True),
        ):
            for time, value in zip(times, keyed.values, strict=True):
                np.testing.assert_array_equal(keyed.at(time), value)
            np.testing.assert_array_equal(keyed.at(times[0] - 1e9), keyed.values[0])
            np.testing.assert_array_equal(keyed.at(times[-1] + 1e9), keyed.values[-1])


def test_steps_stay_until_the_next_key() -> None:
    steps = track([0.0, 1.0, 2.0], [[1.0], [5.0], [9.0]], held=True)
    for time, value in ((0.0, 1.0), (0.999, 1.0), (1.0, 5.0), (1.5, 5.0), (2.0, 9.0)):
        assert float(steps.at(time)[0]) == value
    mixed = Track(steps.times, steps.values, np.array([True, False, True]))
    assert float(mixed.at(0.5)[0]) == 1.0
    assert float(mixed.at(1.5)[0]) == 7.0


@SETTINGS
@given(st.lists(st.floats(-10.0, 10.0), min_size=4, max_size=4), st.floats(0.5, 3.5))
def test_splines_hold_all_cubics(coefficients: list[float], time: float) -> None:
    """Values and slopes of a polynomial of third degree give it back, at any spacing of keys."""
    cubic = np.polynomial.Polynomial(coefficients)
    slope = cubic.deriv()
    times = [0.5, 1.0, 3.5]
    values = [[[slope(t)], [cubic(t)], [slope(t)]] for t in times]
    found = track(times, values).at(time)
    assert float(found[0]) == pytest.approx(cubic(time), abs=1e-9, rel=1e-9)


def test_spline_tangents_are_those_between_their_keys() -> None:
    """The first key's tangent before it and the last one's after it do not matter."""
    wild, calm = (
        [[[99.0], [0.0], [1.0]], [[1.0], [1.0], [99.0]]],
        [[[0], [0], [1]], [[1], [1], [0]]],
    )
    for time in np.linspace(0.0, 1.0, 7):
        assert float(track([0.0, 1.0], wild).at(time)[0]) == pytest.approx(time)
        assert float(track([0.0, 1.0], calm).at(time)[0]) == pytest.approx(time)


def test_splines_of_rotations_are_rotations() -> None:
    start, end = np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.0, 0.8])
    slope = np.array([0.3, 0.2, 0.0, -0.1])
    keyed = track([0.0, 2.0], [[slope, start, slope], [slope, end, slope]], rotation=True)
    s = 0.25
    hermite = (1 + 2 * s) * (1 - s) ** 2 * start + s**2 * (3 - 2 * s) * end
    hermite += 2.0 * (s * (1 - s) ** 2 + s**2 * (s - 1)) * slope
    np.testing.assert_allclose(keyed.at(0.5), hermite / np.linalg.norm(hermite), atol=1e-12)
    # Half way between opposite ones there is no direction: the last key holds.
    opposite = track(
        [0.0, 1.0], [[0 * slope, start, 0 * slope], [0 * slope, -start, 0 * slope]], rotation=True
    )
    np.testing.assert_array_equal(opposite.at(0.5), start)


@SETTINGS
@given(vectors, quaternions, st.lists(st.floats(0.1, 10.0), min_size=3, max_size=3), vectors)
def test_transforms_scale_then_turn_then_move(
    move: Float, turn: Float, scale: list[float], point: Float
) -> None:
    found = transform(move, turn, np.array(scale)) @ [*point, 1.0]
    expected = move + Rotation.from_quat(turn).apply(scale * point)
    np.testing.assert_allclose(found[:3], expected, rtol=1e-9, atol=1e-6)


def test_nodes_follow_the_nodes_above_them() -> None:
    """A clock's hand on a wheel on a cart: parents' motions and the hand's own add up."""
    quarter = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    still = np.array([0.0, 0.0, 0.0, 1.0])
    nodes = {
        7: Node(-1),
        3: Node(7, translation=np.array([0.0, 1.0, 0.0])),
        5: Node(3, matrix=np.diag([2.0, 2.0, 2.0, 1.0])),
    }
    tracks = {
        7: {"translation": track([0.0, 2.0], [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]])},
        3: {"rotation": track([0.0, 1.0], [still, quarter], rotation=True)},
    }
    skeleton = Skeleton(nodes, tracks)
    for time in (0.0, 0.5, 1.0):
        turned = 0.5 * np.pi * time
        tip = skeleton.pose(time)[5] @ [1.0, 0.0, 0.0, 1.0]
        expected = [2.0 * time + 2.0 * np.cos(turned), 1.0 + 2.0 * np.sin(turned), 0.0]
        np.testing.assert_allclose(tip[:3], expected, atol=1e-12)


def test_normals_follow_any_map() -> None:
    """Normals stay at right angles to edges, and outward, also where maps mirror or flatten."""
    rng = np.random.default_rng(1)
    edge, other = rng.normal(size=(2, 50, 3))
    normal = np.cross(edge, other)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    maps = rng.normal(size=(50, 3, 4))
    maps[::5, 0, :3] = 0.0  # flat, onto x = const
    points, normals = moved(edge, normal, maps)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    for along in (edge, other):
        turned = np.einsum("vij,vj->vi", maps[:, :, :3], along)
        assert np.abs((turned * normals).sum(1)).max() < 1e-9
    full = np.arange(50) % 5 != 0
    outward = np.einsum("vij,vj->vi", maps[:, :, :3], normal)
    assert ((outward * normals).sum(1)[full] > 0.0).all()
    np.testing.assert_allclose(
        points, np.einsum("vij,vj->vi", maps[:, :, :3], edge) + maps[:, :, 3]
    )
    gone = np.zeros((1, 3, 4))
    np.testing.assert_array_equal(moved(edge, normal, gone)[1], normal)


def test_skins_mix_their_joints() -> None:
    rng = np.random.default_rng(2)
    pose = {number: np.vstack([rng.normal(size=(3, 4)), [0, 0, 0, 1]]) for number in (4, 9)}
    inverse = np.stack([np.linalg.inv(pose[9]), np.eye(4)])
    skin = Skin(
        np.array([9, 4]), inverse, np.array([[0, 1], [1, 0]]), np.array([[0.25, 0.75], [1, 0]])
    )
    found = skin.matrices(pose)
    np.testing.assert_allclose(found[0], 0.25 * np.eye(4)[:3] + 0.75 * pose[4][:3])
    np.testing.assert_allclose(found[1], pose[4][:3])
