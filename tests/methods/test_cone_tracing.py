"""Voxel cone tracing: voxels and mips against NumPy, cones against closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.methods.voxels import Grid, Voxels
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.kernels.wrap import evaluate
from tests.methods.estimators import PLAIN, Kernels, furnace, kernels
from tests.methods.test_em import CLAY, windowed
from tests.methods.test_estimators import (
    BALL,
    BLACK,
    BOX_VIEW,
    DISC,
    LAMP,
    as_large,
    ball_factor,
    box_of,
    box_truth,
    disc_factor,
)
from tests.rendering import render
from tests.worlds import Float, ball, cuboid, disc, scaled, sphere_frame

COARSE: dict[str, Any] = {"voxels": 32, "object_voxels": 32, "cones": 128}
SUB = 2
"""Rays per column and side (`cl/methods/voxelize_objects.cl`)."""


def vct(**own: Any) -> Settings:
    raw: dict[str, Any] = {"atrous": {"levels": 0}, "mask": {"sparse": False}}
    return Settings.model_validate({"method": "vct", **raw, "vct": {**COARSE, **own}})


def planes_of(run: Kernels, voxels: Voxels) -> tuple[Float, Float]:
    """(X, Y, Z, 4) opacity and light of the finest level."""
    x, y, z = voxels.grid.size
    shown = [
        run.device.read(buffer)[: x * y * z].reshape(z, y, x, 4).swapaxes(0, 2).astype(np.float64)
        for buffer in (voxels.opacity, voxels.light)
    ]
    return shown[0], shown[1]


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
        ["methods/voxels.h"],
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
        ["methods/voxels.h"],
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


@pytest.mark.parametrize("shape", ["ball", "disc"])
def test_errors_of_shadows_shrink_with_voxels(device: ComputeDevice, shape: str) -> None:
    """And with cones: form factors of a ball and of a disc above a plain, under an even sky."""
    made = ball(*BALL, BLACK) if shape == "ball" else disc(*DISC, BLACK)
    errors = []
    for resolution, cones in ((16, 16), (64, 128)):
        own = {**COARSE, "object_voxels": resolution, "cones": cones}
        with kernels(device, furnace("plain"), [made], "vct, even", own=own) as run:
            points, normals = run.receivers()
            wanted = (
                ball_factor(points, normals, BALL[0], as_large(made, BALL[1]))
                if shape == "ball"
                else disc_factor(points, *DISC)
            )
            parts = np.mean([run.parts(seed, 64) for seed in range(4)], axis=0)
            voxel = run.renderer.method.voxels.objects.grid.voxel
        np.testing.assert_array_equal(parts[..., 1, :], 0.0)
        errors.append(parts[..., 0, 0].mean() / wanted.mean() - 1.0)
        # A border as wide as the voxels that a cone meets at the middle of the object.
        away = BALL[0][1] - PLAIN
        border = max(voxel, 0.5 * away * np.sqrt(1.0 / cones))
        assert abs(errors[-1]) < 2.0 * border / BALL[1]
    assert abs(errors[1]) < 0.13
    assert abs(errors[1]) < abs(errors[0])


def test_what_shines_as_bright_as_what_it_hides(device: ComputeDevice) -> None:
    """A white ball in a furnace sends next to what it hides; a half as bright one half of it."""
    with kernels(device, furnace("sphere"), [ball(*BALL, LAMP)], "vct, even", own=COARSE) as run:
        hidden, sent = np.moveaxis(np.mean([run.parts(i, 64) for i in range(4)], axis=0), -2, 0)
    np.testing.assert_array_equal(sent[..., 0], 0.0)
    np.testing.assert_allclose(sent[..., 1].mean(), 0.5 * sent[..., 2].mean(), rtol=1e-3)
    # The plain's reach of the ball is a sphere's wall: nothing is darker.
    assert 0.9 < sent[..., 2].mean() / hidden[..., 2].mean() <= 1.001


@pytest.mark.parametrize("name", ["diffuse", "conductor", "plastic"])
def test_objects_reflect_their_albedo_in_a_furnace(device: ComputeDevice, name: Any) -> None:
    material = Material(name, (0.9, 0.6, 0.3), alpha=0.3)
    frame, own = furnace("sphere"), {**COARSE, "object_voxels": 64}
    with kernels(device, frame, [box_of(material)], "vct, even", view=BOX_VIEW, own=own) as run:
        runs = [run.reflected(seed, 64) for seed in range(4)]
        inside, wanted = box_truth(run, material)
    for kind in runs[0]:
        found = np.mean([one[kind][inside, 0] for one in runs], axis=0)
        np.testing.assert_allclose(found.mean(), wanted[kind].mean(), rtol=0.03)


# Pictures ------------------------------------------------------------------------------------

LOOK = View(48, 36, pitch_deg=-35.0)


@pytest.mark.thorough
def test_two_runs_agree_bit_for_bit(device: ComputeDevice) -> None:
    objects = [ball(*BALL, CLAY), box_of(Material("plastic", alpha=0.2))]
    first, second = (render(device, windowed(), objects, LOOK, vct(), 3).color for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_what_objects_do_not_reach_stays(device: ComputeDevice) -> None:
    """Bit for bit, below an object that lies under the plain."""
    frame = furnace("plain")
    below = ball((0.2, -3.0, -0.9), 0.45, CLAY)
    without = render(device, frame, [], LOOK, vct(), 2).color
    shown = render(device, frame, [below], LOOK, vct(), 2)
    beside = shown.aovs["coverage"] == 0.0
    assert beside.sum() > 500
    np.testing.assert_array_equal(shown.color[beside], without[beside])


def test_light_varies_with_the_place_in_the_room(device: ComputeDevice) -> None:
    """Objects and all, ten times as large, are the same; far walls alone are others."""
    rng = np.random.default_rng(3)
    color = rng.random((32, 64, 3)).repeat(4, 0).repeat(4, 1).astype(np.float32)
    near = replace(sphere_frame(1.9, 256, 128, 1.0), color=color)
    objects = [ball((0.4, -0.5, -1.3), 0.4, CLAY)]

    def shown(frame: Any, placed: list[Instance]) -> Float:
        picture = render(device, frame, placed, LOOK, vct(), 8)
        return np.asarray(picture.color[picture.aovs["coverage"] == 1.0])

    larger = scaled(near, objects, 8.0)
    np.testing.assert_allclose(shown(*larger), shown(near, objects), rtol=1e-3, atol=1e-4)
    far, _ = scaled(near, [], 8.0)
    assert np.abs(shown(far, objects) - shown(near, objects)).mean() > 0.005


def test_moved_objects_take_their_voxels_along(device: ComputeDevice) -> None:
    """A picture after a move is that of a renderer that knew no other place."""
    before, after = [ball((-0.3, -1.0, -0.9), 0.3, CLAY)], [ball(*BALL, CLAY)]
    after = [replace(before[0], to_world=after[0].to_world)]
    with Renderer(device, windowed(), before, LOOK, vct()) as renderer:
        renderer.step()
        renderer.move(after)
        renderer.step()
        moved = device.read(renderer.method.voxels.objects.light)
        size = renderer.method.voxels.objects.finest
    with Renderer(device, windowed(), after, LOOK, vct()) as renderer:
        renderer.step()
        placed = device.read(renderer.method.voxels.objects.light)
    np.testing.assert_array_equal(moved[:size], placed[:size])
