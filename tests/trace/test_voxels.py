"""Voxels: grids around boxes, what fills them, their mips, and cones through them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.trace.voxels import Grid, Voxels, fitted_grid, room_box
from tests.kernels.wrap import evaluate
from tests.trace.closed_forms import BALL, BLACK, DISC
from tests.trace.environments import CLAY
from tests.trace.estimators import Kernels, furnace, kernels
from tests.worlds import Float, ball, cuboid, disc, sphere_frame

COARSE: dict[str, Any] = {"voxels": 32, "object_voxels": 32}
SUB = 2
"""Rays per column and side (`cl/trace/voxelize_objects.cl`)."""


def planes_of(run: Kernels, voxels: Voxels) -> tuple[Float, Float]:
    """(X, Y, Z, 4) opacity and light of the finest level."""
    x, y, z = voxels.grid.size
    shown = [
        run.device.read(buffer)[: x * y * z].reshape(z, y, x, 4).swapaxes(0, 2).astype(np.float64)
        for buffer in (voxels.opacity, voxels.light)
    ]
    return shown[0], shown[1]


# Grids ---------------------------------------------------------------------------------------


def test_grids_hold_their_box() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        low = rng.normal(size=3)
        high = low + 10.0 ** rng.uniform(-4.0, 1.0, 3)
        grid = fitted_grid(low, high, 32)
        size = np.array(grid.size)
        assert size.prod() <= 32**3
        assert (grid.low <= low - 1.5 * grid.voxel).all()
        assert (grid.low + grid.voxel * size >= high + 1.5 * grid.voxel).all()
    assert fitted_grid(np.zeros(3), np.ones(3), 64).voxel == pytest.approx(1.0 / 60.0, rel=0.1)


def test_the_room_is_where_most_surfaces_are() -> None:
    frame = sphere_frame(2.0, 128, 64, 1.0)
    low, high = room_box(frame.depth, 2.0)
    np.testing.assert_allclose([-low, high], 2.0, rtol=0.05)
    far = frame.depth.copy()
    far[:, 60:64] = 1e4
    low, high = room_box(far, 2.0)
    assert max(-low.min(), high.max()) <= 6.0
    nothing = np.full_like(far, np.inf)
    np.testing.assert_array_equal(room_box(nothing, 0.0), [-np.ones(3), np.ones(3)])


# Voxels --------------------------------------------------------------------------------------


def turned_box(half: Float) -> Instance:
    to_world = np.eye(4)
    to_world[:3, :3] = View(1, 1, yaw_deg=25.0, pitch_deg=10.0).world_from_view
    to_world[:3, 3] = (0.3, -1.0, -1.1)
    return replace(cuboid((0, 0, 0), half, CLAY), to_world=to_world)


def box_opacity(grid: Grid, to_world: Float, half: Float) -> Float:
    """(X, Y, Z, 3): the share of rays along each axis that a box stops, by slabs in its space."""
    found = np.zeros((*grid.size, 3))
    for axis in range(3):
        others = [(axis + 1) % 3, (axis + 2) % 3]
        for i, j in np.ndindex(SUB, SUB):
            start = np.zeros((*(grid.size[a] for a in others), 3))
            for a, sub, k in zip(others, (i, j), (0, 1), strict=True):
                place = np.arange(grid.size[a]) + (sub + 0.5) / SUB
                start[..., a] = place[:, None] if k == 0 else place[None, :]
            o = (grid.low + grid.voxel * start - to_world[:3, 3]) @ to_world[:3, :3]
            d = grid.voxel * to_world[axis, :3]
            with np.errstate(divide="ignore"):
                slabs = np.sort(np.stack([(-half - o) / d, (half - o) / d]), 0)
            near, far = slabs
            enter, leave = near.max(-1), far.min(-1)
            enter = np.where(leave - enter < 1.0, leave - 1.0, enter)
            inside = near.max(-1) < leave
            steps = np.arange(grid.size[axis])
            held = (steps >= np.floor(enter)[..., None]) & (steps <= np.floor(leave)[..., None])
            share = np.where(inside[..., None] & held, 1.0 / SUB**2, 0.0)
            found[..., axis] += np.moveaxis(share, [0, 1, 2], [*others, axis])
    return found


def test_a_box_fills_the_voxels_that_it_fills(device: ComputeDevice) -> None:
    half = np.array([0.5, 0.2, 0.15])
    box = turned_box(half)
    with kernels(device, furnace("sphere"), [box], "vct, even", own=COARSE) as run:
        voxels = run.renderer.method.voxels.objects
        opacity, light = planes_of(run, voxels)
    assert len(set(voxels.grid.size)) == 3  # axes are not confused
    wanted = box_opacity(voxels.grid, box.to_world, half)
    assert wanted.max() == 1.0
    # A ray that grazes an edge may fall to either side of it.
    assert (np.abs(opacity[..., :3] - wanted) > 1e-5).mean() < 2e-3
    volume = wanted[..., 0].sum() * voxels.grid.voxel**3
    assert volume == pytest.approx(8.0 * half.prod(), rel=0.15)
    # What has a surface sends light, what is within has none to send.
    lit = light[..., 3] > 0.0
    assert (wanted[lit].max(-1) > 0.0).mean() > 0.99
    assert 0 < lit.sum() < (wanted.max(-1) > 0.0).sum()


def test_a_box_thinner_than_a_voxel_is_solid(device: ComputeDevice) -> None:
    half = np.array([0.5, 0.004, 0.3])
    box = turned_box(half)
    with kernels(device, furnace("sphere"), [box], "vct, even", own=COARSE) as run:
        voxels = run.renderer.method.voxels.objects
        opacity, _ = planes_of(run, voxels)
    wanted = box_opacity(voxels.grid, box.to_world, half)
    assert (np.abs(opacity[..., 1] - wanted[..., 1]) > 1e-5).mean() < 2e-3


@pytest.mark.parametrize("faces", ["up", "down"])
def test_a_sheet_is_two_voxels_thick(device: ComputeDevice, faces: str) -> None:
    """Whichever side of it the rays meet."""
    sheet, over = disc(*DISC, BLACK), np.diag([1.0, -1.0, -1.0, 1.0])
    over[:3, 3] = 2.0 * np.array(DISC[0]) * [0.0, 1.0, 1.0]
    sheet = sheet if faces == "up" else replace(sheet, to_world=over @ sheet.to_world)
    with kernels(device, furnace("plain"), [sheet], "vct, even", own=COARSE) as run:
        voxels = run.renderer.method.voxels.objects
        opacity, _ = planes_of(run, voxels)
    layers = opacity[..., 1].sum(axis=(0, 2)) * voxels.grid.voxel**2
    np.testing.assert_allclose(layers[layers > 0.0], np.pi * DISC[1] ** 2, rtol=0.02)
    assert (layers > 0.0).sum() == 2
    assert opacity[..., [0, 2]].max() == 0.0


def test_room_voxels_lie_at_the_walls(device: ComputeDevice) -> None:
    radius = 2.0
    with kernels(device, furnace("sphere"), [ball(*BALL, BLACK)], "vct, even", own=COARSE) as run:
        voxels = run.renderer.method.voxels.scene
        opacity, light = planes_of(run, voxels)
    grid = voxels.grid
    centres = np.stack(np.indices(grid.size), -1) + 0.5
    away = (np.linalg.norm(grid.low + grid.voxel * centres, axis=-1) - radius) / grid.voxel
    filled = opacity[..., 0] == 1.0
    np.testing.assert_array_equal(filled, opacity[..., 2] == 1.0)
    assert away[filled].min() > -1.0
    assert away[filled].max() < 2.0
    assert filled[(away > -0.4) & (away < 1.2)].all()
    np.testing.assert_allclose(light[filled], 1.0, rtol=1e-5)
    np.testing.assert_array_equal(light[~filled], 0.0)


@pytest.mark.parametrize("anisotropic", [True, False])
def test_eight_voxels_make_one(device: ComputeDevice, anisotropic: bool) -> None:
    voxels = Voxels(device, "test", 24, anisotropic=anisotropic)
    grid = Grid(np.zeros(3), 1.0, (16, 8, 24))
    voxels.place(grid)
    rng = np.random.default_rng(5)
    values = [
        rng.random(buffer.shape).astype(np.float32) for buffer in (voxels.opacity, voxels.light)
    ]
    for buffer, value in zip((voxels.opacity, voxels.light), values, strict=True):
        device.write(buffer, value)
    voxels.reduce()
    shown = [device.read(buffer) for buffer in (voxels.opacity, voxels.light)]

    def level(number: int, which: int) -> Float:
        x, y, z, first = grid.levels[number].tolist()
        block = shown[which][first : first + x * y * z].astype(np.float64)
        return np.asarray(block.reshape(z, y, x, 4).swapaxes(0, 2))

    for number in range(1, len(grid.levels)):
        fine, light = level(number - 1, 0), level(number - 1, 1)
        pad = [(0, n % 2) for n in fine.shape[:3]] + [(0, 0)]
        fine, light = np.pad(fine, pad), np.pad(light, pad)
        mean = np.mean([light[i::2, j::2, k::2] for i, j, k in np.ndindex(2, 2, 2)], axis=0)
        np.testing.assert_allclose(level(number, 1), mean, rtol=1e-5)
        if anisotropic:
            pairs = [
                1.0 - (1.0 - fine[::2, :, :, 0]) * (1.0 - fine[1::2, :, :, 0]),
                1.0 - (1.0 - fine[:, ::2, :, 1]) * (1.0 - fine[:, 1::2, :, 1]),
                1.0 - (1.0 - fine[:, :, ::2, 2]) * (1.0 - fine[:, :, 1::2, 2]),
            ]
            wanted = [
                np.mean([np.take(np.take(of, np.arange(i, of.shape[a], 2), a),
                                 np.arange(j, of.shape[b], 2), b)
                         for i, j in np.ndindex(2, 2)], axis=0)
                for of, (a, b) in zip(pairs, ((1, 2), (0, 2), (0, 1)), strict=True)
            ]  # fmt: skip
        else:
            one = np.mean(
                [fine[i::2, j::2, k::2, :3].mean(-1) for i, j, k in np.ndindex(2, 2, 2)], 0
            )
            wanted = [one] * 3
        np.testing.assert_allclose(level(number, 0)[..., :3], np.stack(wanted, -1), atol=1e-5)
    # What all send together stays.
    halved = [number for number in range(4) if (np.array(grid.size) % 2**number == 0).all()]
    sums = [level(number, 1).sum((0, 1, 2)) * 8.0**number for number in halved]
    np.testing.assert_allclose(sums, np.broadcast_to(sums[0], (len(sums), 4)), rtol=1e-5)


# Cones ---------------------------------------------------------------------------------------


def test_voxels_are_narrow_and_clear_of_the_surface(device: ComputeDevice) -> None:
    """A quarter of the cone's width at most, and 2/3 of its height above where it starts."""
    rng = np.random.default_rng(1)
    voxel, count, n = 0.1, 6, 4000
    slope, rise = rng.uniform(0.0, 1.7, n), rng.uniform(0.0, 1.0, n)
    lift, t = rng.choice([0.0, 0.15, 0.6, 1e30], n), rng.uniform(0.0, 20.0, n)
    inputs = {"slope": slope, "rise": rise, "lift": lift, "t": t}
    found = evaluate(
        device,
        ["trace/voxels.h"],
        """
        const Voxels voxels = {box, box, (__global const int4 *)box, count_of, box[0]};
        const Cone cone = {(float3)(0.0f), (float3)(1.0f, 0.0f, 0.0f), slope, lift, rise};
        level = cone_level(voxels, cone, t);
        """,
        {name: values.astype(np.float32) for name, values in inputs.items()},
        {"level": "int"},
        tables={"box": np.array([[0.0, 0.0, 0.0, voxel]], np.float32)},
        parameters="const int count_of",
        arguments={"count_of": count},
    )["level"]
    most = np.minimum(2.0 * slope * t / 4.0, (lift + rise * t) / 1.5)
    levels = voxel * 2.0 ** np.arange(count)
    wanted = np.maximum((levels <= most[:, None]).sum(1) - 1, 0)
    assert set(wanted) == set(range(count))
    assert (found != wanted).mean() < 1e-3  # those at a limit


@pytest.mark.parametrize("side", [64, 72])
@pytest.mark.parametrize("slope", [0.0, 0.1, 0.4, 1.5])
def test_a_homogeneous_medium_lets_its_exponential_pass(
    device: ComputeDevice, slope: float, side: int
) -> None:
    """From its middle: (1 - a) per voxel along an axis, at any width; what it sends is the rest.

    Wide cones leave a side of 72 in a voxel of 16 of which one half lies outside.
    """
    voxels = Voxels(device, "test", side, anisotropic=True)
    grid = Grid(np.full(3, -0.5 * side), 1.0, (side, side, side))
    voxels.place(grid)
    opacity, light = 0.03, np.array([2.0, 1.0, 0.5])
    for buffer, value in ((voxels.opacity, np.full(4, opacity)), (voxels.light, [*light, 1.0])):
        rows = np.zeros(buffer.shape, np.float32)
        rows[: voxels.finest] = value
        device.write(buffer, rows)
    voxels.reduce()
    d = np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1]], np.float32)
    found = evaluate(
        device,
        ["trace/voxels.h"],
        """
        const Voxels voxels = {opacity, light, (__global const int4 *)levels, count_of, box[0]};
        const Cone cone = {(float3)(0.0f), d, slope, CONE_FAR, 0.0f};
        const ConeLight seen = trace_cone(voxels, cone, 0.0f, 0.0f, 1);
        passed = seen.passed;
        radiance = seen.radiance;
        distance_to = seen.distance;
        """,
        {"d": d, "slope": np.full(3, slope, np.float32)},
        {"passed": "float", "radiance": "float3", "distance_to": "float"},
        tables={
            "opacity": device.read(voxels.opacity),
            "light": device.read(voxels.light),
            "levels": device.read(voxels.levels).view(np.float32),
            "box": np.array([[*grid.low, grid.voxel]], np.float32),
        },
        parameters="const int count_of",
        arguments={"count_of": len(grid.levels)},
    )
    np.testing.assert_allclose(found["passed"], (1.0 - opacity) ** (side // 2), rtol=1e-4)
    np.testing.assert_allclose(
        found["radiance"], (1.0 - found["passed"])[:, None] * light, rtol=1e-4
    )
    if slope == 0.0:
        k = np.arange(side // 2) + 0.5
        mean = (k * (1.0 - opacity) ** k).sum() / ((1.0 - opacity) ** k).sum()
        np.testing.assert_allclose(found["distance_to"], mean, rtol=0.02)
