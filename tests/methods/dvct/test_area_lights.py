"""Discs that stand for a panorama's light, and their shadow maps: closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.methods.dvct.area_lights import aimed, area_lights, median_cut
from tests.kernels.wrap import evaluate
from tests.trace.closed_forms import BALL, BLACK, as_large
from tests.trace.estimators import Kernels, furnace, kernels
from tests.worlds import Float, ball

ROWS, COLUMNS = 32, 64
COARSE: dict[str, Any] = {"voxels": 32, "room_voxels": 32, "lights": 64, "map_side": 32}


def solid_angles(rows: int, columns: int) -> Float:
    edges = np.cos(np.arange(rows + 1) / rows * np.pi)
    return np.repeat((edges[:-1] - edges[1:])[:, None] * 2.0 * np.pi / columns, columns, 1)


def sphere_lights(count: int, radius: float = 2.0) -> Any:
    """Lights of a sphere around the capture centre that radiates 1."""
    directions = View(COLUMNS, ROWS, projection="equirect").directions().astype(np.float64)
    shape = (ROWS, COLUMNS)
    return area_lights(
        np.ones((*shape, 3)), np.full(shape, radius), -directions, np.zeros(shape), count, radius
    )


# Regions -------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 7, 32, 256])
def test_regions_share_the_flux(count: int) -> None:
    """They cover each cell once, and no one has much more of a smooth flux than its part."""
    flux = solid_angles(ROWS, COLUMNS) * (1.2 + np.cos(np.arange(COLUMNS) / COLUMNS * 2.0 * np.pi))
    regions = median_cut(flux, count)
    assert len(regions) == count
    covered = np.zeros((ROWS, COLUMNS), int)
    for r in regions:
        covered[r.top : r.bottom, r.left : r.right] += 1
    np.testing.assert_array_equal(covered, 1)
    parts = [flux[r.top : r.bottom, r.left : r.right].sum() for r in regions]
    assert max(parts) < 2.7 * flux.sum() / count


def test_a_spot_is_found_to_the_cell() -> None:
    flux = np.zeros((ROWS, COLUMNS))
    flux[5, 40] = flux[20, 3] = 1.0
    found = median_cut(flux, 16)
    assert len(found) == 2
    for region in found:
        assert flux[region.top : region.bottom, region.left : region.right].sum() == 1.0
        assert (region.bottom - region.top) * (region.right - region.left) == 1
    assert median_cut(np.zeros((4, 8)), 4) == []


def test_lights_send_to_the_centre_what_regions_do() -> None:
    rng = np.random.default_rng(3)
    radiance = rng.uniform(0.1, 3.0, (ROWS, COLUMNS, 3))
    distance = rng.uniform(1.0, 4.0, (ROWS, COLUMNS))
    normal = rng.normal(size=(ROWS, COLUMNS, 3))
    directions = View(COLUMNS, ROWS, projection="equirect").directions()
    normal = -directions + 0.3 * normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lights = area_lights(radiance, distance, normal, np.zeros_like(distance), 40, 4.0)
    # Their place is a little nearer than the surface.
    place = lights[:, 0, :3] / 0.98
    squared = (place.astype(np.float64) ** 2).sum(-1)
    cosine = -(lights[:, 1, :3] * place).sum(-1) / np.sqrt(squared)
    sent = lights[:, 2, :3] * (cosine / (squared + lights[:, 0, 3]))[:, None]
    whole = (radiance * solid_angles(ROWS, COLUMNS)[..., None]).sum((0, 1))
    np.testing.assert_allclose(sent.sum(0), whole, rtol=1e-4)


def test_windows_send_what_is_behind_them_from_there() -> None:
    """A window's light towards a box is that of the outside in the direction from the box."""
    directions = View(COLUMNS, ROWS, projection="equirect").directions().astype(np.float64)
    opening = (directions @ [0.0, 0.0, -1.0] > 0.98).astype(np.float64)
    shape = (ROWS, COLUMNS)
    light = opening[..., None] * np.ones(3)
    lights = area_lights(light, np.full(shape, 2.0), -directions, opening, 1, 2.0)
    outside = 1.0 + (directions[..., 1:2] > 0.2) * np.array([1.0, 3.0, 7.0])
    low, high = np.array([-0.1, -1.6, -1.1]), np.array([0.1, -1.4, -0.9])
    seen, same = (aimed(lights, low, high, of) for of in (outside, None))
    np.testing.assert_allclose(seen[:, 2, :3], same[:, 2, :3] * [2.0, 4.0, 8.0], rtol=1e-6)
    walls = area_lights(light, np.full(shape, 2.0), -directions, 0.0 * opening, 1, 2.0)
    np.testing.assert_array_equal(aimed(walls, low, high, outside), aimed(walls, low, high, None))


# Light ---------------------------------------------------------------------------------------


def test_lights_make_a_furnace(device: ComputeDevice) -> None:
    """Irradiance over pi inside a sphere that radiates 1 is 1, nearly anywhere."""
    rng = np.random.default_rng(8)
    points, normals = rng.normal(size=(2, 40, 3))
    points *= (rng.uniform(0.0, 1.2, 40) / np.linalg.norm(points, axis=1))[:, None]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    errors = []
    for count in (32, 256):
        lights = aimed(sphere_lights(count), -np.ones(3), np.ones(3), None)
        found = evaluate(
            device,
            ["methods/dvct/area_lights.h"],
            """
            float3 sum = (float3)(0.0f);
            for (int i = 0; i < number; i++)
                sum += light_irradiance(area_light(lights, i), p, n);
            arriving = sum;
            """,
            {"p": points.astype(np.float32), "n": normals.astype(np.float32)},
            {"arriving": "float3"},
            tables={"lights": lights.reshape(-1, 4)},
            parameters="const int number",
            arguments={"number": len(lights)},
        )["arriving"]
        errors.append(np.abs(found[:, 1] - 1.0).max())
        assert abs(found[:, 1].mean() - 1.0) < 0.04
    assert errors[1] < 0.12
    assert errors[1] < errors[0]


def test_places_on_a_map_are_directions(device: ComputeDevice) -> None:
    """There and back; equal areas of the map are equal solid angles, around the objects."""
    lights = aimed(sphere_lights(6), np.full(3, -0.3), np.full(3, 0.3), None)
    side = 24
    at = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2) + 0.5
    which = np.repeat(np.arange(6), len(at)).astype(np.int32)
    places = np.tile(at, (6, 1)).astype(np.float32)
    found = evaluate(
        device,
        ["methods/dvct/area_lights.h"],
        """
        const AreaLight light = area_light(lights, which);
        d = map_direction(light, place, side);
        back = map_place(light, d, side);
        """,
        {"place": places, "which": which},
        {"d": "float3", "back": "float2"},
        tables={"lights": lights.reshape(-1, 4)},
        parameters="const int side",
        arguments={"side": side},
    )
    np.testing.assert_allclose(np.linalg.norm(found["d"], axis=1), 1.0, atol=1e-5)
    np.testing.assert_allclose(found["back"], places, atol=5e-3)
    towards = -lights[which, 0, :3] / np.linalg.norm(lights[which, 0, :3], axis=1)[:, None]
    angle = np.arccos(np.clip((found["d"] * towards).sum(1), -1.0, 1.0))
    # The cap around the box's sphere is a disc that fills the map.
    radius = np.hypot(*(2.0 * places / side - 1.0).T)
    reach = np.arcsin(0.3 * np.sqrt(3.0) / np.linalg.norm(lights[which, 0, :3], axis=1))
    np.testing.assert_allclose(np.sin(0.5 * angle), radius * np.sin(0.5 * reach), atol=2e-4)


def maps_of(run: Kernels) -> tuple[Float, Float]:
    world = run.renderer.method.voxels
    count = world.light_count
    return (
        run.device.read(world.lights)[:count].astype(np.float64),
        run.device.read(world.maps)[:count].astype(np.float64),
    )


def test_maps_show_a_ball_in_a_sphere(device: ComputeDevice) -> None:
    made = ball(*BALL, BLACK)
    with kernels(device, furnace("sphere"), [made], "dvct, even", own=COARSE) as run:
        lights, maps = maps_of(run)
    side = maps.shape[1]
    assert len(lights) == 64
    wrong = total = 0
    for light, seen in zip(lights, maps, strict=True):
        o, axis = light[0, :3], light[3, :3]
        # Discs face the sphere's middle.
        assert light[1, :3] @ -o > 0.99 * np.linalg.norm(light[1, :3]) * np.linalg.norm(o) > 0.0
        # From each texel's distance, how near its ray can come to the ball's middle.
        away = np.asarray(BALL[0]) - o
        distance = float(np.linalg.norm(away))
        hit = np.isfinite(seen[..., 0])
        at = (np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1) + 0.5) / side
        half_angle = np.linalg.norm(2.0 * at - 1.0, axis=-1) * light[3, 3]
        inside = half_angle < 1.0
        # The ball's box is a cube around it: its middle is on the axis.
        np.testing.assert_allclose(axis, away / distance, atol=1e-3)
        angle = 2.0 * np.arcsin(np.minimum(half_angle, 1.0))
        meets = inside & (angle < np.arcsin(as_large(made, BALL[1]) / distance))
        wrong += (hit != meets).sum()
        total += hit.size
        nearest = distance * np.cos(angle) - np.sqrt(
            np.maximum(BALL[1] ** 2 - (distance * np.sin(angle)) ** 2, 0.0)
        )
        both = hit & meets & (angle < 0.8 * np.arcsin(BALL[1] / distance))
        np.testing.assert_allclose(seen[both, 0], nearest[both], atol=0.02 * BALL[1])
        # Chords of the sphere from a light's place, along the axis.
        middle = seen[side // 2 - 1 : side // 2 + 1, side // 2 - 1 : side // 2 + 1, 1].mean()
        b = float(o @ axis)
        np.testing.assert_allclose(middle, -b + np.sqrt(b * b - o @ o + 4.0), rtol=0.02)
    assert wrong < 0.02 * total


def test_maps_tell_what_is_lit(device: ComputeDevice) -> None:
    """Before a ball all arrives, behind it what real surfaces let pass, behind these nothing."""
    side, cap = 16, 0.2
    light = np.zeros((1, 4, 4), np.float32)
    light[0, 1:, :3] = [[0, 0, -1], [1, 1, 1], [0, 0, -1]]
    light[0, 3, 3] = cap
    maps = np.zeros((side * side, 4), np.float32)
    maps[:, 0], maps[:, 1] = np.inf, 5.0
    objects = maps.reshape(side, side, 4)[:, : side // 2]
    objects[..., 0] = 2.0
    x = np.array(
        [
            [-0.1, 0, -1],
            [-0.3, 0, -3],
            [-0.6, 0, -6],
            [0.3, 0, -3],
            [0.6, 0, -6],
            [0, 0, -3],
            [-9, 0, -3],
            [0.3, 0, -4.5],
            [0.3, 0, -5.05],
        ],
        np.float32,
    )
    found = evaluate(
        device,
        ["methods/dvct/area_lights.h"],
        """
        const AreaLights lights = {rows, (__global const float2 *)texels, 1, side};
        passing = light_passing(lights, 0, area_light(rows, 0), x, 0.01f);
        """,
        {"x": x},
        {"passing": "float2"},
        tables={"rows": light.reshape(-1, 4), "texels": maps[:, :2].reshape(-1, 4)},
        parameters="const int side",
        arguments={"side": side},
    )["passing"]
    wanted = [[1, 1], [1, 0], [0, 0], [1, 1], [0, 0], [1, 0.5], [1, 1]]
    # In front of real surfaces, and within half a texel behind them: they do not shadow themselves.
    wanted += [[1, 1], [1, 1]]
    np.testing.assert_allclose(found, wanted, atol=1e-5)
