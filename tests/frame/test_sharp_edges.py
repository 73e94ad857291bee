"""Depth edges in the whole frame."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.oracles.worlds import Box, World
from tests.worlds import Float, Radiance, cuboid, room_frame

pytestmark = pytest.mark.gl

CLAY = Material(albedo=(0.3, 0.3, 0.3))
BOARD = World(solids=(Box((0.0, -0.55, -1.0), (0.12, 0.3, 0.02), 0.3),))


def dark_before_bright(points: Float, normals: Float) -> Float:
    """A dark board in a bright room."""
    board = (points[..., 2:] > -1.3) & (points[..., 1:2] > -1.0) & (points[..., 1:2] < -0.2)
    return np.where(board & (np.abs(points[..., :1]) < 0.2), 0.06, 2.0) * np.ones(3)


def averaged_frame(radiance: Radiance) -> Frame:
    """The room with the board, in texels that show means."""
    fine = room_frame(BOARD, 8 * 192, 8 * 96, radiance).color
    mixed = fine.reshape(96, 8, 192, 8, 3).mean(axis=(1, 3))
    return replace(room_frame(BOARD, 192, 96, radiance), color=mixed)


def shown_and_hidden(box: Box, view: View, texels: Float | None = None) -> tuple[Float, Float]:
    """(H, W) the parts of each pixel in which a box is in front of the room and behind it, means of
    8x8 points; the room is exact, or as deep as the texels of a panorama.
    """
    steps = (np.arange(8) + 0.5) / 8
    shown, hidden = np.zeros((2, view.height, view.width))
    x, y = np.meshgrid(np.arange(view.width), np.arange(view.height))
    for u, v in itertools.product(steps, steps):
        d = view.unproject(np.stack([x + u, y + v], axis=-1))
        room = BOARD.first_hit(np.zeros(3), d)[0]
        if texels is not None:
            column, row = equirect_pixel(d, texels.shape[1], texels.shape[0]).astype(int).T
            room = texels[row.T, column.T]
        there = box.interval(np.zeros(3), d)[0]
        shown += there < room
        hidden += np.isfinite(there) & (there >= room)
    return shown / 64, hidden / 64


@pytest.mark.thorough
@pytest.mark.parametrize("depth", [-0.6, -1.6, -3.0], ids=["in front", "between", "behind"])
def test_real_edges_cut_objects_as_finely_as_the_view(device: ComputeDevice, depth: float) -> None:
    """A box covers what it does in the room: in front of a dark board, between it and a bright
    wall, and behind both. Where the board cuts it, the wall does not shine through.
    """
    box = Box((0.0, 0.4 * depth, depth), (0.4, -0.15 * depth, 0.05))
    view = View(128, 96, pitch_deg=-20.0, fov_y_deg=40.0)
    frame = averaged_frame(dark_before_bright)
    things = [cuboid(box.centre, box.half, CLAY)]
    with Renderer(device, frame, things, view, Settings()) as renderer:
        picture = renderer.render(4, ["coverage"])
        edge = device.read(renderer.real.other_pixel).reshape(view.height, view.width) >= 0
    shown, hidden = shown_and_hidden(box, view)
    error = np.abs(picture.aovs["coverage"] - shown)
    assert error[edge].mean() < 0.01
    assert not error[~edge & (hidden == 1.0)].any()
    cut = edge & (shown > 0.0) & (hidden > 0.0)
    assert (cut.sum() > 60) == (depth == -1.6)
    if cut.any():
        by_texel = np.abs(shown_and_hidden(box, view, frame.depth)[0] - shown)
        assert error[cut].mean() < 0.4 * by_texel[cut].mean()
        inside = picture.color[cut & (shown + hidden == 1.0)]
        assert inside.max() < 1.05 * picture.color[shown == 1.0].max()
