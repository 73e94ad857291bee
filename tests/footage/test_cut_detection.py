"""Cuts are told from light that changes, by what surfaces there are and by their details."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.cut_detection import is_cut
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from tests.oracles.light import flux_change
from tests.oracles.worlds import Box, World
from tests.worlds import Float, bright_walls, filmed, pose_at

ROOM = World(
    solids=(Box((-0.8, -0.9, -1.7), (0.25, 0.5, 0.2)), Box((1.5, -0.5, 1.0), (0.3, 0.9, 0.4)))
)
HOME = pose_at()


def papered(points: Float, normals: Float) -> Float:
    """Walls with a pattern of tiles a hand wide, in many shades."""
    shade = np.sin(7.0 * points @ [[1.0], [1.7], [0.6]]) + np.sin(
        9.0 * points @ [[0.3], [-1.1], [1.9]]
    )
    return np.asarray((1.0 + 0.4 * shade) * bright_walls(points, normals))


FRAME = filmed(ROOM, 256, 128, papered, HOME)


def cut(before: Frame, after: Frame) -> bool:
    return is_cut(before, after, flux_change(before.color, after.color))


def lit_from(lamp: Float, frame: Frame = FRAME, ambient: float = 0.02) -> Frame:
    """The same surfaces, in the light of a lamp."""
    d = View(frame.width, frame.height, projection="equirect").directions()
    away = lamp - d * frame.depth[..., None]
    squared = np.maximum((away**2).sum(-1), 0.01)
    light = np.maximum((away * frame.normal).sum(-1), 0.0) / squared**1.5
    return replace(frame, color=(frame.color * (ambient + light)[..., None]).astype(np.float32))


def rolled(frame: Frame, *parts: str) -> Frame:
    return replace(frame, **{name: np.roll(getattr(frame, name), 128, 1) for name in parts})


@pytest.mark.parametrize("factor", [0.02, 0.4, 0.9, 1.5, 30.0])
def test_exposure_is_no_cut(factor: float) -> None:
    assert not cut(FRAME, replace(FRAME, color=FRAME.color * np.float32(factor)))


@pytest.mark.parametrize("lamp", [(0.5, 1.0, 0.0), (-1.0, 0.5, -1.0), (2.0, 0.0, 2.0)], ids=str)
def test_switched_lamps_are_no_cut(lamp: tuple[float, float, float]) -> None:
    """Although most of the flux changes, and from where it comes."""
    other = lit_from(np.array(lamp))
    assert flux_change(FRAME.color, other.color) > 0.6
    assert not cut(FRAME, other)
    assert not cut(other, FRAME)
    assert not cut(other, lit_from(np.array([0.0, -1.0, 2.5])))


def test_noise_in_the_dark_is_no_cut() -> None:
    rng = np.random.default_rng(0)

    def dark() -> Frame:
        noise = rng.normal(0.0, 0.02, FRAME.color.shape)
        return replace(FRAME, color=np.maximum(0.02 * FRAME.color + noise, 0.0).astype(np.float32))

    assert flux_change(dark().color, dark().color) > 0.4
    assert not cut(dark(), dark())
    assert not cut(FRAME, dark())


def test_another_place_is_one_however_bright() -> None:
    """The room turned about: as bright as before, its surfaces or its pictures elsewhere."""
    assert cut(FRAME, rolled(FRAME, "color", "depth", "normal"))
    assert cut(FRAME, rolled(FRAME, "depth", "normal"))
    assert cut(FRAME, rolled(FRAME, "color"))
    assert cut(lit_from(np.array([0.0, 1.0, 0.0])), rolled(FRAME, "color", "depth", "normal"))


def test_estimated_depth_may_waver() -> None:
    waves = 1.0 + 0.04 * np.random.default_rng(1).normal(size=FRAME.depth.shape)
    assert not cut(FRAME, replace(FRAME, depth=(1.3 * waves * FRAME.depth).astype(np.float32)))


def test_moving_things_are_no_cut() -> None:
    other = World(solids=(*ROOM.solids, Box((0.5, -0.4, -1.0), (0.3, 0.9, 0.2))))
    assert not cut(FRAME, filmed(other, 256, 128, papered, HOME))


@pytest.mark.parametrize(
    "pose", [pose_at((0.2, 0.1, -0.2)), pose_at((0.0, 0.0, 0.1), 90.0, 10.0)], ids=["walk", "turn"]
)
def test_moving_cameras_are_no_cut(pose: NDArray[np.float64]) -> None:
    after = filmed(ROOM, 256, 128, papered, pose)
    assert not cut(FRAME, after)
    # Without poses, surfaces and pictures are elsewhere.
    assert cut(replace(FRAME, pose=None), replace(after, pose=None))
    assert cut(FRAME, rolled(after, "color", "depth", "normal"))


def test_a_walk_without_poses_is_no_cut() -> None:
    after = filmed(ROOM, 256, 128, papered, pose_at((0.04, 0.01, -0.03)))
    assert not cut(replace(FRAME, pose=None), replace(after, pose=None))


def test_open_sky_and_tiny_panoramas() -> None:
    for size in ((2, 1), (8, 4), (29, 15)):
        small = filmed(ROOM, *size, papered, HOME)
        with np.errstate(divide="raise", invalid="raise"):
            assert not cut(small, small)
            assert not cut(small, replace(small, color=2.0 * small.color))
    open_sky = replace(FRAME, depth=np.full_like(FRAME.depth, np.inf))
    assert not cut(open_sky, open_sky)
    assert cut(FRAME, open_sky)
