"""Drift of exposure and white balance: known maps are found again, light is none, noise is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.files.images import decode_srgb
from iprt.footage.frame import Frame
from iprt.footage.prepare.exposure import Drift
from iprt.geometry.camera import View
from tests.footage.lamp_rooms import srgb
from tests.oracles.worlds import Box, World
from tests.worlds import Float, bright_walls, landscape_frame, room_frame, sphere_frame

ROOM = World(solids=(Box((-0.8, -0.9, -1.7), (0.25, 0.5, 0.2)),))
WIDTH, HEIGHT = 256, 128
FRAME = room_frame(ROOM, WIDTH, HEIGHT, bright_walls)
MAPS = {
    "half": 0.5 * np.eye(3),
    "double": 2.0 * np.eye(3),
    "warmer": np.diag([1.3, 1.0, 0.7]),
    "crosstalk": np.array([[0.9, 0.08, 0.02], [0.03, 0.92, 0.05], [0.0, 0.1, 0.9]]),
    "all": 0.6 * np.array([[1.2, 0.05, 0.0], [0.02, 1.0, 0.02], [0.0, 0.08, 0.8]]),
}
Camera = Callable[[NDArray[np.floating], int], NDArray[np.float32]]


def noisy(color: NDArray[np.floating], seed: int, amount: float = 0.02) -> NDArray[np.float32]:
    """Each value off by so much of itself."""
    noise = np.random.default_rng(seed).normal(size=color.shape)
    return np.maximum(color * (1.0 + amount * noise), 0.0).astype(np.float32)


def eight_bits(color: NDArray[np.floating], seed: int) -> NDArray[np.float32]:
    """As an 8-bit sRGB picture shows a noisy view: clipped and in 256 steps."""
    return decode_srgb(srgb(noisy(color, seed)))


def exact(color: NDArray[np.floating], seed: int) -> NDArray[np.float32]:
    return color.astype(np.float32)


CAMERAS: dict[str, tuple[Camera, float, float]] = {
    "exact": (exact, np.inf, 1e-5),
    "noise": (noisy, np.inf, 0.003),
    "8 bits": (eight_bits, 1.0, 0.005),
}
"""How a camera shows light, what it clips, and by how much the colors that its map gives may be
off."""


def shown(frame: Frame, camera: Camera, seed: int, color_map: Float | None = None) -> Frame:
    """The frame as a camera with those colors shows it."""
    color = frame.color if color_map is None else frame.color @ color_map.T
    return replace(frame, color=camera(color, seed))


def off(found: Float | None, true: Float, color: NDArray[np.floating]) -> float:
    """By how much `found` misses the inverse of `true`: RMS, relative to each color."""
    found = np.eye(3) if found is None else found
    difference = color @ (found @ true).T - color
    size = color.mean(-1, keepdims=True)
    return float(np.sqrt(((difference / size) ** 2).mean()))


def lamp(at: tuple[float, float, float], strength: float) -> Frame:
    """The room with a lamp more, whose light the walls reflect in their colors."""
    points = FRAME.depth[..., None] * View(WIDTH, HEIGHT, projection="equirect").directions()
    towards = np.array(at) - points
    distance = np.linalg.norm(towards, axis=-1)
    cosine = np.maximum((towards * FRAME.normal).sum(-1) / distance, 0.0)
    light = strength * (cosine / distance**2)[..., None] * np.array([1.0, 0.8, 0.5])
    return replace(FRAME, color=(FRAME.color * (1.0 + light)).astype(np.float32))


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", MAPS)
def test_known_maps_are_found(name: str, camera: str) -> None:
    shows, white, bound = CAMERAS[camera]
    # So that twice the light does not clip all of it.
    world = replace(FRAME, color=0.4 * FRAME.color)
    drift = Drift(white)
    assert drift(shown(world, shows, 0)).color_map is None
    mapped = drift(shown(world, shows, 1, MAPS[name]))
    assert off(mapped.color_map, MAPS[name], world.color) < bound


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_steady_video_has_no_map(camera: str) -> None:
    shows, white, _ = CAMERAS[camera]
    drift = Drift(white)
    for seed in range(6):
        frame = shown(FRAME, shows, seed)
        assert drift(frame) is frame


def test_drift_that_cannot_be_seen_is_none() -> None:
    drift = Drift()
    drift(FRAME)
    for gain in (1.001, 0.999):
        frame = shown(FRAME, exact, 0, gain * np.eye(3))
        assert drift(frame) is frame


def test_a_nearly_grey_room_tells_no_crosstalk() -> None:
    """Colors that differ by less than noise would make a map that takes colors away."""
    grey = FRAME.color.mean(axis=-1, keepdims=True)
    world = replace(FRAME, color=(grey + 0.02 * (FRAME.color - grey)).astype(np.float32))
    drift = Drift()
    drift(replace(world, color=noisy(world.color, 0, 0.05)))
    found = drift(replace(world, color=noisy(2.0 * world.color, 1, 0.05))).color_map
    assert off(found, 2.0 * np.eye(3), FRAME.color) < 0.01


def test_a_reference_without_colors_takes_none_away() -> None:
    """Though the map that explains it best does, and cannot be undone."""
    grey = FRAME.color.mean(axis=-1, keepdims=True)
    world = replace(FRAME, color=(grey + 0.05 * (FRAME.color - grey)).astype(np.float32))
    drift = Drift()
    drift(replace(world, color=np.repeat(grey, 3, axis=-1)))
    found = drift(shown(world, exact, 0, 0.5 * np.eye(3))).color_map
    assert off(found, 0.5 * np.eye(3), FRAME.color) < 0.02


@pytest.mark.parametrize("camera", ["exact", "8 bits"])
def test_moving_things_do_not_count(camera: str) -> None:
    """A dark thing passes close by, over a fifth of the sphere; another part changes its color."""
    shows, white, bound = CAMERAS[camera]
    world = replace(FRAME, color=0.5 * FRAME.color)
    depth, color = world.depth.copy(), world.color.copy()
    depth[40:90, 20:105] = 0.3
    color[40:90, 20:105] = (0.05, 0.1, 0.3)
    color[50:80, 150:180] *= (2.0, 0.5, 1.0)
    after = replace(world, depth=depth, color=color)
    for true in (np.eye(3), MAPS["all"]):
        drift = Drift(white)
        drift(shown(world, shows, 0))
        mapped = drift(shown(after, shows, 1, true))
        assert off(mapped.color_map, true, world.color) < bound
        assert (mapped.color_map is None) == (true is not MAPS["all"])


def test_clipped_texels_do_not_count() -> None:
    """What is clipped in one of the frames tells too small a change."""
    drift = Drift(white=1.0)
    drift(shown(FRAME, eight_bits, 0))
    brighter = 1.15 * np.eye(3)
    frame = shown(FRAME, eight_bits, 1, brighter)
    assert (frame.color == 1.0).any(axis=-1).mean() > 0.15
    assert off(drift(frame).color_map, brighter, FRAME.color) < 0.005


@pytest.mark.parametrize("color", [(0.5, 0.5, 0.5), (0.6, 0.3, 0.1), (0.4, 0.0, 0.0)])
def test_one_color_tells_a_scale_per_channel(color: tuple[float, float, float]) -> None:
    wall = sphere_frame(2.0, 64, 32, 1.0)
    wall = replace(wall, color=wall.color * np.array(color, np.float32))
    gains = np.array([2.0, 1.5, 1.2])
    drift = Drift()
    drift(shown(wall, noisy, 0))
    found = drift(shown(wall, noisy, 1, np.diag(gains))).color_map
    assert found is not None
    lit = np.array(color) > 0.0
    np.testing.assert_allclose(np.diag(found)[lit], 1.0 / gains[lit], rtol=0.01)
    assert np.abs(found - np.diag(np.diag(found))).max() < 0.02
    assert np.isfinite(found).all()


LAMPS = [(0.2, 1.2, -0.5), (1.0, -0.5, 0.5), (0.0, 0.3, 0.0)]


@pytest.mark.parametrize("strength", [0.05, 0.2, 1.0, 5.0])
@pytest.mark.parametrize("at", LAMPS)
def test_a_lamp_is_no_drift(at: tuple[float, float, float], strength: float) -> None:
    drift = Drift()
    drift(FRAME)
    lit = lamp(at, strength)
    assert drift(lit) is lit


def test_the_light_may_change_while_colors_drift() -> None:
    """The map that holds goes on to hold when a lamp goes on, and drift is found after it."""
    lit = lamp(LAMPS[0], 3.0)
    drift = Drift()
    drift(shown(FRAME, noisy, 0))
    found = [
        drift(shown(world, noisy, seed, true)).color_map
        for seed, (world, true) in enumerate(
            [(FRAME, MAPS["half"]), (lit, MAPS["half"]), (lit, MAPS["all"]), (lit, np.eye(3))], 1
        )
    ]
    assert np.array_equal(found[0], found[1])
    assert off(found[2], MAPS["all"], FRAME.color) < 0.005
    assert off(found[3], np.eye(3), FRAME.color) < 0.005


def test_a_cut_begins_anew() -> None:
    other = replace(landscape_frame(WIDTH, HEIGHT), color=FRAME.color[::-1].copy())
    drift = Drift()
    drift(FRAME)
    assert drift(shown(FRAME, exact, 0, MAPS["half"])).color_map is not None
    assert drift(other) is other
    assert (
        off(drift(shown(other, exact, 0, MAPS["all"])).color_map, MAPS["all"], other.color) < 1e-4
    )


@pytest.mark.parametrize("gain", [20.0, 0.05])
def test_absurd_gains_are_not_applied(gain: float) -> None:
    drift = Drift()
    drift(FRAME)
    frame = replace(FRAME, color=FRAME.color * np.float32(gain))
    assert drift(frame) is frame


def test_black_frames_are_harmless() -> None:
    """A film that fades out and in keeps the map that it had, and no value is not finite."""
    black = replace(FRAME, color=np.zeros_like(FRAME.color))
    drift = Drift()
    assert drift(black) is black
    assert drift(FRAME) is FRAME
    halved = drift(shown(FRAME, exact, 0, MAPS["half"])).color_map
    assert halved is not None
    dark = drift(black)
    assert dark.color_map is halved
    assert not dark.radiance.any()
    assert drift(FRAME) is FRAME
    with np.errstate(all="raise"):
        for share in (1e-30, 1e-6, 1.0):
            assert np.isfinite(drift(replace(black, color=share * FRAME.color)).radiance).all()


def test_light_may_have_any_unit() -> None:
    maps = []
    for unit in (1e-4, 1.0, 1e4):
        drift = Drift()
        world = replace(FRAME, color=FRAME.color * np.float32(0.4 * unit))
        drift(shown(world, noisy, 0))
        maps.append(drift(shown(world, noisy, 1, MAPS["all"])).color_map)
    for found in maps:
        np.testing.assert_allclose(found, maps[1], atol=1e-5)


def test_a_ramp_is_followed_without_lag_or_drift() -> None:
    """Exposure doubles over 16 frames and returns; errors do not add up."""
    gains = np.concatenate([np.geomspace(1.0, 2.0, 17), np.geomspace(2.0, 1.0, 17)])
    drift = Drift()
    errors = []
    for seed, gain in enumerate(gains):
        mapped = drift(shown(FRAME, noisy, seed, gain * np.eye(3)))
        errors.append(off(mapped.color_map, gain * np.eye(3), FRAME.color))
    assert max(errors) < 0.004


def test_drift_is_followed_while_the_light_changes_a_little() -> None:
    """Light that has changed since the reference does not hide how colors drift now."""
    gains = np.exp(0.3 * np.sin(np.linspace(0.0, np.pi, 16)) ** 2)
    drift = Drift()
    errors = []
    for number, gain in enumerate(gains):
        mapped = drift(shown(lamp(LAMPS[0], 0.02 * number), exact, 0, gain * np.eye(3)))
        errors.append(off(mapped.color_map, gain * np.eye(3), FRAME.color))
    # What one map explains of the lamp cannot be told from drift.
    assert np.abs(np.diff(errors)).max() < 0.003


def test_the_map_is_found_while_the_camera_moves() -> None:
    """The reference is looked up where the surfaces were; far off, a later frame stands in."""
    drift = Drift()
    d = View(WIDTH, HEIGHT, projection="equirect").directions()
    for step in range(6):
        at = np.array([0.2 * step, 0.05 * step, -0.15 * step])
        pose = np.eye(4)
        pose[:3, :3] = View(1, 1, 30.0 * step).world_from_view
        pose[:3, 3] = at
        w = d @ pose[:3, :3].T
        t, normal, _ = ROOM.first_hit(at, w)
        gain = 1.1**step
        color = bright_walls(at + t[..., None] * w, normal)
        frame = replace(
            FRAME, color=(gain * color).astype(np.float32), depth=t.astype(np.float32), pose=pose
        )
        mapped = drift(frame)
        assert off(mapped.color_map, gain * np.eye(3), color) < 0.01, step


@pytest.mark.parametrize(("width", "height"), [(2, 1), (6, 3), (64, 32), (258, 129), (1030, 515)])
def test_any_size(width: int, height: int) -> None:
    frame = room_frame(World(), width, height, bright_walls)
    drift = Drift()
    drift(frame)
    found = drift(shown(frame, exact, 0, 2.0 * np.eye(3))).color_map
    np.testing.assert_allclose(found, 0.5 * np.eye(3), atol=1e-3)
