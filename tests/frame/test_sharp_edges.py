"""Depth edges in the whole frame: no rims, no specks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.model import Settings
from tests.oracles.worlds import Box, World
from tests.rendering import render
from tests.worlds import Float, ball, room_frame

pytestmark = pytest.mark.gl

CLAY = Material(albedo=(0.3, 0.3, 0.3))
BOARD = World(solids=(Box((0.0, -0.55, -1.0), (0.12, 0.3, 0.02), 0.3),))
VIEW = View(128, 96, pitch_deg=-30.0, fov_y_deg=40.0)


def lamp(points: Float, normals: Float) -> Float:
    """Light from the ceiling only, on grey."""
    return np.where(normals[..., 1:2] < -0.5, 3.0, 0.3) * np.ones(3)


def dark_board(points: Float, normals: Float) -> Float:
    """The same, in checks, but for a board in the middle of the room."""
    board = (points[..., 2:] > -1.3) & (points[..., 1:2] > -1.0) & (points[..., 1:2] < -0.2)
    checks = np.sign(np.sin(40.0 * points[..., :1]) * np.sin(40.0 * points[..., 2:]))
    return np.where(board, 0.06, lamp(points, normals) * (2.0 + 0.5 * checks))


def settings(**chosen: Any) -> Settings:
    return Settings.model_validate(chosen)


def test_edges_have_no_rim(device: ComputeDevice) -> None:
    """A dark board before a shadowed floor: pixels at its edge lie between both sides."""
    fine = room_frame(BOARD, 8 * 192, 8 * 96, dark_board).color
    mixed = fine.reshape(96, 8, 192, 8, 3).mean(axis=(1, 3))
    frame = replace(room_frame(BOARD, 192, 96, dark_board), color=mixed)
    picture = render(device, frame, [ball((0.0, -1.12, -2.0), 0.27, CLAY)], VIEW, settings(), 32)
    board = BOARD.first_hit(np.zeros(3), VIEW.directions())[2] == 1
    shown = picture.color[..., 0]
    edge = maximum_filter(board, 9) & ~minimum_filter(board, 9)
    covered = maximum_filter(picture.aovs["coverage"], 9) > 0.0
    high = maximum_filter(np.where(edge | covered, 0.0, shown), 15)
    low = minimum_filter(np.where(edge | covered, np.inf, shown), 15)
    tested = edge & ~covered
    assert tested.sum() > 200
    assert (picture.aovs["ratio"][tested][:, 0] < 0.8).sum() > 20
    assert (shown[tested] < 1.1 * high[tested]).all()
    assert (shown[tested] > 0.9 * low[tested]).all()
