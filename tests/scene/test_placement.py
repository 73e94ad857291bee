"""Objects that are set down on noisy depth stand on the surface, and meet their shadow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.prepare.denoise import smoothed
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_texel
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.placement import RealSurfaces, set_down
from tests.oracles.worlds import Box, World
from tests.rendering import render
from tests.worlds import cuboid, room_frame

WIDTH, HEIGHT = 1024, 512
FLOOR = -1.4
TABLE_TOP = -0.8
ROOM = World(low=(-4.0, FLOOR, -4.0), high=(4.0, 1.3, 4.0))
TABLE = World(solids=(Box((0.0, -0.85, -1.5), (0.6, 0.05, 0.4)),))
CUBE = cuboid((0.0, 0.0, 0.0), (0.5, 0.5, 0.5), Material(albedo=(0.0, 0.0, 0.0)))
BOARD = cuboid((0.0, 0.0, 0.0), (0.5, 0.5, 0.01), Material(albedo=(0.0, 0.0, 0.0)))
DISTANCES = [1.6, 2.0, 3.5]
NOISE = 0.02
YAWS_DEG = range(0, 360, 45)


def shared(noise: float) -> NDArray[np.float64]:
    """(H, W) relative error with a standard deviation of `noise`, much the same over 4 degrees."""
    random = np.random.default_rng(0)
    directions = View(WIDTH, HEIGHT, projection="equirect").directions()
    error = np.zeros((HEIGHT, WIDTH))
    for frequency in random.normal(size=(48, 3)) / np.radians(4.0 * np.sqrt(2.0)):
        error += np.sin(directions @ frequency + random.uniform(0.0, 2.0 * np.pi))
    return noise * error / error.std()


def white(noise: float) -> NDArray[np.float64]:
    return noise * np.random.default_rng(0).normal(size=(HEIGHT, WIDTH))


def off(frame: Frame, error: NDArray[np.float64]) -> Frame:
    """With an error of depth, as it is when a source has read it."""
    depth = smoothed((frame.depth * (1.0 + error)).astype(np.float32))
    return replace(frame, depth=depth, normal=None)


def seat(
    surfaces: RealSurfaces, distance: float, yaw_deg: float, thing: Instance = CUBE
) -> Instance:
    """A cube or board, a fifth of its distance large, on the floor that far away."""
    pitch_deg = float(np.degrees(np.arcsin(FLOOR / distance)))
    to_world = set_down(surfaces, thing.mesh, yaw_deg, pitch_deg, MeshPose()).to_world
    return Instance("thing", thing.mesh, to_world)


def foot(instance: Instance) -> float:
    """y of its lowest side."""
    return float(instance.to_world[1, 3] - 0.5 * instance.to_world[1, 1])


def ground(frame: Frame, instance: Instance) -> float:
    """Mean y of what the depth of `frame` puts under the object."""
    directions = View(WIDTH, HEIGHT, projection="equirect").directions()
    distance, _, _ = ROOM.first_hit(np.zeros(3), directions)
    true = directions * distance[..., None]
    half = 0.5 * instance.to_world[0, 0]
    under = np.abs(true - instance.to_world[:3, 3])[..., [0, 2]].max(axis=-1) < half
    under &= true[..., 1] < FLOOR + 1e-6
    return float((directions * frame.depth[..., None])[under, 1].mean())


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02])
def test_the_foot_is_on_the_true_floor_within_a_fraction_of_white_noise(noise: float) -> None:
    surfaces = RealSurfaces(off(ROOM.frame(WIDTH, HEIGHT), white(noise)))
    gaps = [foot(seat(surfaces, d, yaw)) - FLOOR for d in DISTANCES for yaw in YAWS_DEG]
    assert np.abs(gaps).max() < max(0.1 * noise * -FLOOR, 1e-5)


@pytest.mark.thorough
def test_the_foot_is_on_the_floor_that_rays_meet_where_errors_are_shared() -> None:
    """Within half of the error, RMS, and no more above than below."""
    frame = off(ROOM.frame(WIDTH, HEIGHT), shared(NOISE))
    surfaces = RealSurfaces(frame)
    for distance in DISTANCES:
        cubes = [seat(surfaces, distance, yaw) for yaw in range(0, 360, 30)]
        gaps = [foot(cube) - ground(frame, cube) for cube in cubes]
        assert np.sqrt(np.mean(np.square(gaps))) < 0.5 * NOISE * -FLOOR
        assert abs(np.mean(gaps)) < 0.1 * NOISE * -FLOOR


def test_stray_points_do_not_lift_objects() -> None:
    """Two texels in a hundred lie 10 cm above an exact floor."""
    frame = ROOM.frame(WIDTH, HEIGHT)
    stray = np.random.default_rng(0).uniform(size=(HEIGHT, WIDTH)) < 0.02
    stray &= frame.depth < 3.0
    raised = replace(frame, depth=np.where(stray, frame.depth * np.float32(0.93), frame.depth))
    for distance in DISTANCES:
        cube = seat(RealSurfaces(raised), distance, 0.0)
        assert foot(cube) == pytest.approx(FLOOR, abs=1e-4)


def test_a_stray_texel_is_not_where_objects_go() -> None:
    """The one that is looked at lies 14 cm below the floor, or above it."""
    frame = ROOM.frame(WIDTH, HEIGHT)
    pitch_deg = float(np.degrees(np.arcsin(FLOOR / 2.0)))
    row, column = equirect_texel(View(1, 1, 20.0, pitch_deg).directions()[0, 0], WIDTH, HEIGHT)
    for error in (0.9, 1.1):
        depth = frame.depth.copy()
        depth[row, column] *= error
        cube = seat(RealSurfaces(replace(frame, depth=depth)), 2.0, 20.0)
        assert foot(cube) == pytest.approx(FLOOR, abs=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_objects_at_the_edge_of_a_table_stand_on_the_table(noise: float) -> None:
    """The middle is 5 cm from the edge, with floor below a quarter; or wholly beside the table."""
    surfaces = RealSurfaces(off(TABLE.frame(WIDTH, HEIGHT), white(noise)))
    for x, y in ((0.55, TABLE_TOP), (1.1, FLOOR)):
        height = surfaces.height_below(x, -1.5, 0.15, y + 0.05)
        assert height == pytest.approx(y, abs=max(0.2 * noise, 1e-4))


def with_deep_nadir() -> Frame:
    """A room whose depth is 14 m within 6 degrees of the nadir."""
    frame = ROOM.frame(WIDTH, HEIGHT)
    deep = np.arange(HEIGHT)[:, None] >= HEIGHT * (1.0 - 6.0 / 180.0)
    depth = np.where(deep, np.float32(14.0), frame.depth)
    return replace(frame, depth=depth, normal=None)


@pytest.mark.parametrize("height_m", [0.05, 0.1, 0.4])
def test_few_points_far_below_are_not_the_floor(height_m: float) -> None:
    """Their area is larger than the floor's under the object, since it grows with depth squared."""
    surfaces = RealSurfaces(with_deep_nadir())
    for pitch_deg in (-80.0, -70.0, -50.0, -45.0, -35.0):
        for yaw_deg in YAWS_DEG:
            pose = MeshPose(height_m=height_m)
            to_world = set_down(surfaces, CUBE.mesh, yaw_deg, pitch_deg, pose).to_world
            assert foot(Instance("cube", CUBE.mesh, to_world)) == pytest.approx(FLOOR, abs=1e-3)


def test_what_stands_on_them_is_named() -> None:
    surfaces = RealSurfaces(with_deep_nadir())
    to_world = set_down(surfaces, CUBE.mesh, 0.0, -89.0, MeshPose(height_m=0.4)).to_world
    deep = Instance("cube", CUBE.mesh, to_world)
    assert foot(deep) < -13.0, "there the view shows nothing else"
    (warning,) = surfaces.placement_faults(deep)
    assert "13 m below the floor" in warning
    ordinary = RealSurfaces(ROOM.frame(WIDTH, HEIGHT))
    assert ordinary.placement_faults(seat(ordinary, 2.0, 0.0)) == []


def test_what_stands_on_nothing_is_named() -> None:
    frame = ROOM.frame(WIDTH, HEIGHT)
    sky = np.where(np.arange(HEIGHT)[:, None] > HEIGHT // 2, np.inf, frame.depth)
    surfaces = RealSurfaces(replace(frame, depth=sky.astype(np.float32), normal=None))
    (warning,) = surfaces.placement_faults(seat(RealSurfaces(frame), 2.0, 0.0))
    assert "nothing below it faces up" in warning


@pytest.mark.parametrize("width", [0.3, 0.5, 0.8])
def test_in_a_niche_objects_stay_near_and_cut_no_wall_or_say_so(width: float) -> None:
    """Two walls 0.6 m apart push what is wider from one to the other."""
    solids = (Box((-0.8, 0.0, -2.9), (0.5, 2.0, 1.0)), Box((0.8, 0.0, -2.9), (0.5, 2.0, 1.0)))
    world = World(low=ROOM.low, high=ROOM.high, solids=solids)
    surfaces = RealSurfaces(world.frame(WIDTH, HEIGHT))
    pitch_deg = float(np.degrees(np.arctan2(FLOOR, 2.3)))
    placed = set_down(surfaces, CUBE.mesh, 4.0, pitch_deg, MeshPose(height_m=width))
    asked = 2.3 * np.array([np.sin(np.radians(4.0)), -np.cos(np.radians(4.0))])
    shift = np.hypot(*(placed.to_world[[0, 2], 3] - asked))
    assert shift <= width + 1e-6
    radius = width / np.sqrt(2.0)
    x, _, z = placed.to_world[:3, 3]
    free = 0.3 - abs(x) > 0.98 * radius or -z < 1.9 - 0.7 * radius
    assert free == placed.fits
    assert bool(placed.warnings()) != placed.fits
    if width == 0.3:
        assert placed.fits
        assert -z > 2.0, "it has room there"


def wall_lamp(points: NDArray[np.float64], _: NDArray[np.float64]) -> NDArray[np.float64]:
    """A lamp from 0.8 m to 1.4 m above the floor, at yaw 180 degrees."""
    lit = (points[..., 2] > 3.99) & (np.abs(points[..., 0]) < 0.3)
    lit &= np.abs(points[..., 1] + 0.3) < 0.3
    return np.where(lit, 100.0, 0.1)[..., None] * np.ones(3)


@pytest.mark.thorough
def test_shadows_begin_at_the_foot_of_what_stands_on_noisy_depth(device: ComputeDevice) -> None:
    """The lamp is behind a thin board. If that floats, light goes below it."""
    frame = off(room_frame(ROOM, WIDTH, HEIGHT, wall_lamp), white(NOISE))
    board = seat(RealSurfaces(frame), 3.5, 180.0, BOARD)
    ahead = float(np.degrees(np.arctan2(FLOOR, board.to_world[2, 3] - 0.025)))
    view = View(65, 65, 180.0, ahead, 10.0)
    ratio = render(device, frame, [board], view, frames=8, aovs=("ratio",)).aovs["ratio"]
    assert ratio[31:34, 22:43].mean() < 0.3
