"""The web viewer's cameras and gizmos: conventions of viser and ours, there and back."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.viewer.gizmo import polar
from iprt.viewer.web.camera import ORBIT_M, camera_of, look_of, position_of, quaternion, rotation


@pytest.mark.parametrize("pitch", [-90.0, -89.999, -30.0, 0.0, 45.0, 90.0])
@pytest.mark.parametrize("yaw", [-179.0, -90.0, 0.0, 10.0, 135.0])
def test_views_become_cameras_and_back(yaw: float, pitch: float) -> None:
    """Straight up and down, too, where a direction alone would not tell the yaw."""
    view = View(64, 48, yaw, pitch, 37.0)
    found = look_of(view, quaternion(camera_of(view)), np.deg2rad(37.0))
    assert found.yaw_deg == pytest.approx(yaw, abs=1e-6)
    assert found.pitch_deg == pytest.approx(pitch, abs=2e-5)
    assert found.fov_y_deg == pytest.approx(37.0)


def test_cameras_see_what_views_see() -> None:
    """viser's axes are right, down and forward; it looks at the capture centre from beside it."""
    view = View(64, 48, 30.0, -20.0)
    right, down, forward = camera_of(view).T
    middle = view.unproject(np.array([32.0, 24.0]))
    np.testing.assert_allclose(forward, middle, atol=1e-12)
    assert view.project(middle + 0.1 * right)[0] > 32.0
    assert view.project(middle + 0.1 * down)[1] > 24.0
    np.testing.assert_allclose(position_of(view), -ORBIT_M * middle, atol=1e-15)


def test_quaternions_of_all_rotations() -> None:
    random = np.random.default_rng(0)
    turns = [*random.standard_normal((50, 4)), *np.eye(4)]
    for turn in turns:
        unit = turn / np.linalg.norm(turn)
        matrix = rotation(unit)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(matrix) == pytest.approx(1.0)
        found = quaternion(matrix)
        np.testing.assert_allclose(found * np.sign(found @ unit), unit, atol=1e-9)


def test_turns_are_parted_from_stretches() -> None:
    """Also of mirrored and sheared objects: what a gizmo shows is a rotation."""
    random = np.random.default_rng(1)
    for mirror in (1.0, -1.0):
        linear = random.standard_normal((3, 3)) + 2.0 * np.eye(3)
        linear[:, 0] *= mirror * np.sign(np.linalg.det(linear))
        turn, stretch = polar(linear)
        np.testing.assert_allclose(turn @ stretch, linear, atol=1e-12)
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1.0)
