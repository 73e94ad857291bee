"""The clocks of the video and of the objects, and what a view sees of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.oracles.worlds import World
from tests.worlds import ball, bright_walls, ceiling_lamp, room_frame

LOOK = View(32, 24, pitch_deg=-30.0)
BALL = ball((0.0, -0.8, -1.5), 0.3, Material())
SETTINGS = Settings()


@pytest.fixture(scope="module")
def bright() -> Frame:
    return room_frame(World(), 64, 32, bright_walls)


@pytest.fixture(scope="module")
def dim() -> Frame:
    return room_frame(World(), 64, 32, ceiling_lamp)


def test_a_frame_is_loaded_once(device: ComputeDevice, bright: Frame, dim: Frame) -> None:
    with Renderer(device, bright, [], LOOK, SETTINGS) as renderer:
        real = renderer.real_world
        renderer.load(bright)
        assert real.version == 1
        renderer.load(dim)
        assert (real.version, real.frame) == (2, dim)


def test_a_cut_counts_though_its_frame_was_skipped(
    device: ComputeDevice, bright: Frame, dim: Frame
) -> None:
    """Histories of the frame before the cut end, and those of the frame after it go on."""
    with Renderer(device, bright, [BALL], LOOK, SETTINGS) as renderer:
        assert history(renderer, 4) > 2.0
        renderer.load(dim)
        renderer.load(replace(dim, color=dim.color.copy()))
        assert history(renderer, 1) <= 1.0
        assert history(renderer, 3) > 2.0


def test_objects_rest_after_the_frame_that_moves_them(device: ComputeDevice, dim: Frame) -> None:
    there = replace(BALL, to_world=BALL.to_world.copy())
    there.to_world[0, 3] += 0.2
    with Renderer(device, dim, [BALL], LOOK, SETTINGS) as renderer:
        assert motion(renderer) < 1e-3
        renderer.move([there])
        assert motion(renderer) > 1.0
        assert motion(renderer) < 1e-3


def test_objects_placed_before_the_first_frame_have_not_moved(
    device: ComputeDevice, dim: Frame
) -> None:
    there = replace(BALL, to_world=BALL.to_world.copy())
    there.to_world[0, 3] += 0.2
    with Renderer(device, dim, [BALL], LOOK, SETTINGS) as renderer:
        renderer.move([there])
        assert motion(renderer) < 1e-3
        placed = renderer.render(3).color
    with Renderer(device, dim, [there], LOOK, SETTINGS) as renderer:
        renderer.render(1)
        np.testing.assert_array_equal(renderer.render(3).color, placed)


def history(renderer: Renderer, frames: int) -> float:
    """Frames that the longest temporal mean is worth after so many more."""
    return float(renderer.render(frames, ["history_length"]).aovs["history_length"].max())


def motion(renderer: Renderer) -> float:
    """Pixels that the objects moved by in the next frame, at most."""
    aovs = renderer.render(1, ["motion", "coverage"]).aovs
    rows, columns = np.mgrid[: LOOK.height, : LOOK.width] + 0.5
    moved = aovs["motion"] - np.stack([columns, rows], axis=-1)
    return float(np.abs(moved[aovs["coverage"] > 0.99]).max())
