"""Depth edges in the whole frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.oracles.worlds import Box, World
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


def test_both_sides_of_an_edge_are_relit(device: ComputeDevice) -> None:
    """A dark board before a shadowed floor: pixels that show both have some of either's ratio."""
    fine = room_frame(BOARD, 8 * 192, 8 * 96, dark_board).color
    mixed = fine.reshape(96, 8, 192, 8, 3).mean(axis=(1, 3))
    frame = replace(room_frame(BOARD, 192, 96, dark_board), color=mixed)
    things = [ball((0.0, -1.12, -2.0), 0.27, CLAY)]
    with Renderer(device, frame, things, VIEW, Settings()) as renderer:
        picture = renderer.render(8, ["ratio", "background", "coverage"])
        share = renderer.layout.interior(device.read(renderer.real.other))[0]
        assert renderer.signals.ratio is not None
        own = device.read(renderer.signals.ratio).reshape(*share.shape, 4)[..., :3]
    real = picture.aovs["coverage"] == 0.0
    ratio = picture.aovs["ratio"]
    assert (real & (share > 0.05) & (np.abs(ratio - own).max(-1) > 0.02)).sum() > 20
    np.testing.assert_array_equal(ratio[share == 0.0], own[share == 0.0])
    relit = picture.aovs["background"] * ratio
    np.testing.assert_allclose(picture.color[real], relit[real], rtol=1e-5)
