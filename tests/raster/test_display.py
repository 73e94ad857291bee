"""Outputs of shaded rendering: coverage against the real scene, borrowed edges, motion."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.raster.layers import COVERAGE_TOLERANCE, NO_MOTION, SAMPLES
from tests.raster.shapes import Float, direction, mesh, placed, quad, rasterizer, sphere

pytestmark = pytest.mark.gl

PERSPECTIVE = View(63, 47, yaw_deg=30.0, pitch_deg=-20.0, fov_y_deg=50.0)
EQUIRECT = View(96, 47, projection="equirect")


def sub_directions(view: View) -> Float:
    """(H, W, SAMPLES^2, 3) directions of the coverage samples."""
    step = (np.arange(SAMPLES) + 0.5) / SAMPLES
    x = np.arange(view.width)[None, :, None, None] + step[None, None, None, :]
    y = np.arange(view.height)[:, None, None, None] + step[None, None, :, None]
    points = np.stack(np.broadcast_arrays(x, y), axis=-1)
    return view.unproject(points).reshape(view.height, view.width, -1, 3)


def ball_distance(directions: Float, centre: Float, radius: float) -> Float:
    """First hit of a sphere; inf where there is none."""
    along = directions @ centre
    with np.errstate(invalid="ignore"):
        hit = along - np.sqrt(radius**2 - (centre @ centre - along**2))
    return np.where(hit > 0.0, hit, np.inf)


def shade(instances: list[Instance], view: View, surface: Float | None = None):
    with rasterizer(instances) as opened:
        if surface is not None:
            opened.set_surface(surface.astype(np.float32))
        return opened.render(view, shade=True)


@pytest.mark.parametrize(
    ("view", "yaw", "pitch"),
    [
        (PERSPECTIVE, 32, -18),
        (PERSPECTIVE, 52, -40),
        (EQUIRECT, 20, 5),
        (EQUIRECT, 180, -30),
        (EQUIRECT, 0, 80),
    ],
)
def test_coverage_of_a_ball(view: View, yaw: float, pitch: float) -> None:
    centre = 3.0 * direction(yaw, pitch)
    layers = shade([placed(sphere(4), centre, 0.8)], view)
    expected = np.isfinite(ball_distance(sub_directions(view), centre, 0.8)).mean(axis=-1)
    area = expected.sum()
    assert area > 30.0
    assert abs(layers.coverage.sum() - area) < 0.008 * area
    assert np.abs(layers.coverage - expected).max() <= 3.0 / SAMPLES**2


def test_coverage_of_a_ball_in_the_floor() -> None:
    """A ball sunk to its middle in a real floor shows the part that is above it."""
    view, centre = PERSPECTIVE, np.array([1.6, -1.0, -2.6])
    rows = np.arange(64)
    surface = np.zeros((64, 128, 4))
    surface[rows >= 32, :, 1] = -1.0  # y = -1: r = 1 / -d_y
    layers = shade([placed(sphere(4), centre, 0.7)], view, surface)

    d = sub_directions(view)
    ball = ball_distance(d, centre, 0.7)
    with np.errstate(divide="ignore"):
        floor = np.where(d[..., 1] < 0.0, -1.0 / d[..., 1], np.inf)
    visible = np.isfinite(ball) & (ball <= floor * (1.0 + COVERAGE_TOLERANCE))
    assert 0.3 < visible.sum() / np.isfinite(ball).sum() < 0.9
    expected = visible.mean(axis=-1)
    assert abs(layers.coverage.sum() / expected.sum() - 1.0) < 0.01
    assert np.abs(layers.coverage - expected).mean() < 1e-3


@pytest.mark.parametrize("view", [PERSPECTIVE, EQUIRECT])
def test_coverage_tolerance(view: View) -> None:
    """A board 0.4% behind a real wall still shows; 0.6% behind, it does not."""
    towards = direction(30.0, -20.0)
    surface = np.zeros((1, 1, 4))
    surface[0, 0, :3] = towards / 2.0  # the plane at distance 2 that faces the centre
    right = np.cross(towards, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(right, towards), -towards], axis=1)
    for behind, shown in ((0.004, True), (0.006, False)):
        board = placed(quad(), 2.0 * (1.0 + behind) * towards, 0.4, rotation)
        layers = shade([board], view, surface)
        inside = layers.front.geometry[..., 3] > 0.0
        assert inside.sum() > 30
        assert layers.coverage.max() == (1.0 if shown else 0.0)


def test_coverage_in_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles leave no seams."""
    shell = [placed(sphere(1), 3.0 * direction(30.0, -20.0)), placed(quad(), (0, 0, 3), name="b")]
    whole = [shade(shell, view) for view in (PERSPECTIVE, EQUIRECT)]
    monkeypatch.setattr("iprt.raster.rasterizer._TILE", 10)
    for expected, view in zip(whole, (PERSPECTIVE, EQUIRECT), strict=True):
        found = shade(shell, view)
        np.testing.assert_allclose(found.coverage, expected.coverage, atol=1.01 / SAMPLES**2)
        np.testing.assert_array_equal(found.front.geometry > 0, expected.front.geometry > 0)


@pytest.mark.parametrize("view", [PERSPECTIVE, EQUIRECT])
def test_borrowed_edges(view: View) -> None:
    """Covered pixels whose centre misses a tilted board continue its plane; they have no back."""
    turn, tilt = np.deg2rad([30.0, 25.0])
    turned = np.array(
        [[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]]
    )
    tilted = np.array(
        [[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]]
    )
    rotation = turned @ tilted
    centre = 2.5 * direction(31.0, -18.0)
    with rasterizer([placed(quad(), centre, 0.7, rotation)]) as opened:
        plain = opened.render(view, shade=False)
        layers = opened.render(view, shade=True)
    own = plain.front.geometry[..., 3] > 0.0
    borrowed = (layers.front.geometry[..., 3] > 0.0) & ~own
    assert borrowed.sum() > 4
    np.testing.assert_array_equal(layers.front.geometry[own], plain.front.geometry[own])
    np.testing.assert_array_equal((layers.coverage > 0.0) & ~own, borrowed)
    assert not layers.back.geometry[borrowed].any()
    assert not layers.back.material[borrowed].any()

    normal = rotation[:, 2]
    plane = (centre @ normal) / (view.directions()[borrowed] @ normal)
    np.testing.assert_allclose(layers.front.geometry[borrowed][:, 3], plane, rtol=1e-4)
    np.testing.assert_allclose(
        layers.front.geometry[borrowed][:, :3], np.tile(normal, (borrowed.sum(), 1)), atol=1e-6
    )
    assert (layers.front.material[borrowed] == layers.front.material[own][0]).all()


def test_borrowing_is_bounded() -> None:
    """A board seen nearly edge-on, less than two pixels wide, lends at most 3% of distance.

    Its plane would change the distance by a third from one pixel to the next.
    """
    view = View(64, 64, fov_y_deg=60.0)
    towards = view.directions()[32, 32]
    angle = np.arctan2(towards[0], -towards[2]) + np.deg2rad(88.0)
    across = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    along = np.cross([0.0, 1.0, 0.0], across)
    board = placed(quad(), 3.0 * towards, 1.0, np.stack([along, [0, 1, 0], across], axis=1))
    with rasterizer([board]) as opened:
        own = opened.render(view, shade=False).front.geometry[32, :, 3]
        lent = opened.render(view, shade=True).front.geometry[32, :, 3]
    assert own[32] > 0.0
    borrowed = lent[(own == 0.0) & (lent > 0.0)]
    assert len(borrowed) > 0
    np.testing.assert_allclose(np.abs(borrowed / own[32] - 1.0), 0.03, atol=1e-5)


@pytest.mark.parametrize(
    "view", [View(32, 32, fov_y_deg=60.0), View(64, 32, projection="equirect")]
)
def test_slivers_without_any_centre_vanish(view: View) -> None:
    """Less than a pixel, between pixel centres: no surface to borrow, so no coverage."""
    corners = view.unproject(np.array([[20.6, 12.6], [21.4, 12.6], [21.0, 13.4]])) * 2.0
    with rasterizer([placed(mesh(corners, np.array([[0, 1, 2]])))]) as opened:
        layers = opened.render(view, shade=True)
    assert not layers.coverage.any()
    assert not layers.front.geometry.any()


@pytest.mark.parametrize(
    ("view", "previous"),
    [
        (PERSPECTIVE, View(63, 47, yaw_deg=26.0, pitch_deg=-23.0, fov_y_deg=55.0)),
        (EQUIRECT, View(96, 47, yaw_deg=5.0, pitch_deg=3.0, projection="equirect")),
    ],
)
def test_motion(view: View, previous: View) -> None:
    """Against View.project, with objects that turn, shrink, and stand still."""
    centre = 3.0 * direction(30.0, -20.0)
    turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    before = placed(sphere(2), centre, 0.7, name="moving")
    after = placed(sphere(2), centre + np.array([0.2, 0.1, -0.1]), 0.6, turn, name="moving")
    still = placed(quad(), 4.0 * direction(40.0, -15.0), name="still")
    with rasterizer([before, still]) as opened:
        first = opened.render(view, shade=True)
        opened.move([after, still])
        second = opened.render(view, previous, shade=True)
        opened.move([after, still])
        third = opened.render(view, shade=True)
        owner = opened.material_object

    own = np.broadcast_to(view.project(view.directions()), (view.height, view.width, 2))
    displaced = before.to_world @ np.linalg.inv(after.to_world)
    for layers, motion, then in ((first, np.eye(4), view), (second, displaced, previous)):
        geometry = layers.front.geometry.astype(np.float64)
        seen = geometry[..., 3] > 0.0
        index = layers.front.material[..., 3].astype(int) - 1
        moving = seen & (owner[index] == 0)
        assert moving.sum() > 30
        assert (seen & ~moving).sum() > 15
        points = view.directions() * geometry[..., 3:]
        old = np.where(moving[..., None], points @ motion[:3, :3].T + motion[:3, 3], points)
        difference = (layers.motion - then.project(old))[seen]
        if view.projection == "equirect":
            difference[:, 0] -= view.width * np.round(difference[:, 0] / view.width)
        assert np.abs(difference).max() < 2e-3
        assert (layers.motion[~seen] == NO_MOTION).all()
    seen = third.front.geometry[..., 3] > 0.0
    np.testing.assert_allclose(third.motion[seen], own[seen], atol=2e-3)


def test_motion_from_behind_the_camera() -> None:
    board = placed(quad(), (0.0, 0.0, 3.0))
    with rasterizer([board]) as opened:
        opened.move([placed(quad(), (0.0, 0.0, -3.0))])
        layers = opened.render(View(16, 16), shade=True)
    seen = layers.front.geometry[..., 3] > 0.0
    assert seen.any()
    assert (layers.motion[seen] == NO_MOTION).all()


def test_tracing_layers_have_no_display() -> None:
    with rasterizer([placed(quad(), (0, 0, -3))]) as opened:
        layers = opened.render(View(16, 16), shade=False)
        with pytest.raises(ValueError, match="same projection"):
            opened.render(View(16, 16), EQUIRECT, shade=True)
    assert layers.coverage is None
    assert layers.motion is None
