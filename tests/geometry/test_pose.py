"""Poses: what they do to views, objects and points."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.pose import camera_motion, inverse_pose, seen_from, view_from
from tests.worlds import ball, pose_at

HERE = pose_at((0.3, -0.2, 1.1), 40.0, -15.0)
THERE = pose_at((-0.4, 0.1, 0.2), 170.0, 8.0)
VIEW = View(32, 24, yaw_deg=20.0, pitch_deg=-30.0)


def test_a_view_looks_where_it_did_in_the_world() -> None:
    seen = view_from(VIEW, HERE)
    np.testing.assert_allclose(seen.directions() @ HERE[:3, :3].T, VIEW.directions(), atol=1e-12)
    assert (seen.width, seen.height, seen.fov_y_deg) == (32, 24, VIEW.fov_y_deg)
    assert seen.resized(8, 6).world_from_view == pytest.approx(seen.world_from_view)


def test_equirect_views_show_the_capture_centres_axes() -> None:
    whole = View(64, 32, projection="equirect")
    assert view_from(whole, HERE) is whole
    assert view_from(VIEW, None) is VIEW
    assert view_from(VIEW, pose_at((1.0, 2.0, 3.0))) is VIEW


def test_objects_stay_in_the_world() -> None:
    before = [ball((0.1, 0.2, -1.0), 0.3, Material())]
    (seen,) = seen_from(before, HERE)
    np.testing.assert_allclose(HERE @ seen.to_world, before[0].to_world, atol=1e-12)
    assert seen_from(before, None) == tuple(before)


def test_motion_takes_points_to_where_they_were_seen() -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    motion = camera_motion(HERE, THERE)
    world = points @ THERE[:3, :3].T + THERE[:3, 3]
    wanted = (world - HERE[:3, 3]) @ HERE[:3, :3]
    np.testing.assert_allclose(points @ motion[:, :3].T + motion[:, 3], wanted, atol=1e-12)
    np.testing.assert_allclose(inverse_pose(HERE) @ HERE, np.eye(4), atol=1e-12)


def test_a_camera_that_stays_moves_nothing_to_the_last_bit() -> None:
    np.testing.assert_array_equal(camera_motion(HERE, HERE.copy()), np.eye(4)[:3])
    np.testing.assert_array_equal(camera_motion(None, None), np.eye(4)[:3])
    with pytest.raises(ValueError, match="all frames of a video have poses"):
        camera_motion(None, HERE)
