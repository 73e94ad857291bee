"""The irradiance cache is looked up between its cells, and never across edges."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from tests.kernels.wrap import evaluate
from tests.oracles.worlds import World
from tests.worlds import Float

Tables = dict[str, NDArray[np.float32]]

ROOM = World()
ROWS = 32


LOOKUP = """
const IrradianceCache cache = {cache_plane, cache_value, 64, 32, 0.0f};
e = cached_irradiance(cache, p, n);
"""


def corner_tables(floor: float, wall: float) -> Tables:
    """A room of which the cache knows all cells; the floor's value, and that of all else."""
    d = View(2 * ROWS, ROWS, projection="equirect").directions().reshape(-1, 3)
    t, normal, _ = ROOM.first_hit(np.zeros(3), d)
    g = normal / (t[:, None] * d * normal).sum(-1, keepdims=True)
    plane = np.concatenate([g, np.ones((len(d), 1))], axis=1)
    value = np.where(normal[:, 1] > 0.5, floor, wall)[:, None] * np.ones(3)
    known = np.concatenate([value, np.full((len(d), 1), 8.0)], axis=1)
    return {"cache_plane": plane.astype(np.float32), "cache_value": known.astype(np.float32)}


def looked_up(
    device: ComputeDevice,
    tables: Tables,
    points: Float,
    normals: Float,
    second: Tables | None = None,
    flux: Float | None = None,
) -> NDArray[np.float32]:
    """E_R of which the red part is kept; `second`: what cells know of thin surfaces; `flux`: of
    first ones, (N, 3).
    """
    second = (
        {name: np.zeros_like(table) for name, table in tables.items()} if second is None else second
    )
    both = {name: np.concatenate([tables[name], second[name]]) for name in tables}
    fluxes = np.zeros_like(both["cache_value"])
    if flux is not None:
        fluxes[: len(flux), :3] = flux
    both["cache_value"] = np.concatenate([both["cache_value"], fluxes])
    inputs = {"p": points.astype(np.float32), "n": normals.astype(np.float32)}
    found = evaluate(device, ["world/real/irradiance.h"], LOOKUP, inputs, {"e": "float3"}, both)[
        "e"
    ]
    return np.asarray(found[:, 0])


def surface_points(count: int, seed: int = 0) -> tuple[Float, Float]:
    d = np.random.default_rng(seed).normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    t, normal, _ = ROOM.first_hit(np.zeros(3), d)
    return t[:, None] * d, normal


def far_from_edges(points: Float) -> NDArray[np.bool_]:
    gaps = np.minimum(points - ROOM.low, np.asarray(ROOM.high) - points)
    return np.asarray(np.sort(gaps, axis=-1)[:, 1] > 0.5)


def test_floor_and_wall_do_not_mix(device: ComputeDevice) -> None:
    """Up to the edge between them, wherever one of the four cells around is of the surface."""
    points, normals = surface_points(20_000)
    found = looked_up(device, corner_tables(1.0, 5.0), points, normals)
    on_floor = normals[:, 1] > 0.5
    column, row = (equirect_pixel(points, 64, 32) - 0.5).T
    of_floor = corner_tables(1.0, 5.0)["cache_value"][:, 0].reshape(32, 64) == 1.0
    x, y = np.floor(column).astype(int), np.floor(row).astype(int)
    around = np.stack(
        [of_floor[np.clip(y + j, 0, 31), (x + i) % 64] for i in (0, 1) for j in (0, 1)]
    )
    mixed = around.any(0) & ~around.all(0)
    assert (mixed & on_floor).sum() > 300
    assert (mixed & ~on_floor).sum() > 300
    np.testing.assert_allclose(found[on_floor & around.any(0)], 1.0, rtol=1e-5)
    np.testing.assert_allclose(found[~on_floor & ~around.all(0)], 5.0, rtol=1e-5)


def test_it_is_bilinear_on_a_surface(device: ComputeDevice) -> None:
    """Also across the seam and at the poles, but for a thousandth that all known cells have."""
    tables = corner_tables(1.0, 1.0)
    column, row = np.meshgrid(np.arange(64), np.arange(32))
    value = 2.0 + np.sin(2.0 * np.pi * column / 64) + 0.05 * row
    tables["cache_value"][:, :3] = value.reshape(-1, 1)
    points, normals = surface_points(20_000)
    found = looked_up(device, tables, points, normals)
    x, y = (equirect_pixel(points, 64, 32) - 0.5).T
    at = (x * 2.0 * np.pi / 64, np.clip(y, 0.0, 31.0))
    wanted = 2.0 + np.sin(at[0]) + 0.05 * at[1]
    inner = far_from_edges(points)
    assert inner.sum() > 5000
    np.testing.assert_allclose(found[inner], wanted[inner], atol=0.02)


def test_unknown_cells_do_not_count(device: ComputeDevice) -> None:
    tables = corner_tables(2.0, 2.0)
    unknown = np.random.default_rng(4).random(32 * 64) < 0.6
    tables["cache_value"][unknown] = 0.0
    points, normals = surface_points(5000)
    found = looked_up(device, tables, points, normals)
    x, y = np.floor(equirect_pixel(points, 64, 32) - 0.5).astype(int).T
    known = ~unknown.reshape(32, 64)
    around = np.stack([known[np.clip(y + j, 0, 31), (x + i) % 64] for i in (0, 1) for j in (0, 1)])
    np.testing.assert_allclose(found[around.any(0)], 2.0, rtol=1e-5)
    assert (found[~around.any(0)] == 0.0).all()
    assert (~around.any(0)).sum() > 200


def test_a_surface_that_no_cell_knows_takes_the_most_of_those_around(device: ComputeDevice) -> None:
    """Only known cells count."""
    tables = corner_tables(1.0, 1.0)
    rng = np.random.default_rng(6)
    tables["cache_value"][:, :3] = rng.random((32 * 64, 1))
    tables["cache_value"][rng.random(32 * 64) < 0.3] = 0.0
    points, normals = surface_points(5000)
    # No wall faces away from the room.
    found = looked_up(device, tables, points, -normals)
    x, y = np.floor(equirect_pixel(points, 64, 32) - 0.5).astype(int).T
    value = tables["cache_value"][:, 0].reshape(32, 64)
    around = [value[np.clip(y + j, 0, 31), (x + i) % 64] for i in (0, 1) for j in (0, 1)]
    np.testing.assert_allclose(found, np.max(around, axis=0), rtol=1e-6)


def test_a_second_surface_counts_where_no_first_one_does(device: ComputeDevice) -> None:
    """A shelf at the height -0.3 that no cell shows at its centre."""
    first, second = corner_tables(1.0, 1.0), corner_tables(9.0, 9.0)
    second["cache_plane"][:, :3] = (0.0, 1.0 / -0.3, 0.0)
    points, normals = surface_points(5000)
    np.testing.assert_allclose(looked_up(device, first, points, normals, second), 1.0, rtol=1e-5)
    same, inner = corner_tables(9.0, 9.0), far_from_edges(points)
    found = looked_up(device, first, points, normals, same)
    np.testing.assert_allclose(found[inner], 1.0, rtol=1e-5)
    below = points[points[:, 1] < -0.5]
    on_shelf = below * (-0.3 / below[:, 1:2])
    up = np.broadcast_to((0.0, 1.0, 0.0), on_shelf.shape)
    np.testing.assert_allclose(looked_up(device, first, on_shelf, up, second), 9.0, rtol=1e-5)
    np.testing.assert_allclose(looked_up(device, first, on_shelf, up), 1.0, rtol=1e-5)


# Normals between ------------------------------------------------------------------------------


def turned(normals: Float, angle: float, seed: int = 0) -> Float:
    """The normals, each turned by an angle, to any side."""
    aside = np.random.default_rng(seed).normal(size=normals.shape)
    aside -= (aside * normals).sum(-1, keepdims=True) * normals
    aside /= np.linalg.norm(aside, axis=-1, keepdims=True)
    return np.cos(angle) * normals + np.sin(angle) * aside


def lit_from(light: Float) -> tuple[Tables, Float]:
    """A room whose surfaces all receive light from one direction: grey E_R, and its flux."""
    tables = corner_tables(1.0, 1.0)
    g = tables["cache_plane"][:, :3].astype(np.float64)
    normal = -g / np.linalg.norm(g, axis=-1, keepdims=True)
    tables["cache_value"][:, :3] = np.maximum(normal @ light, 0.0)[:, None]
    return tables, np.where(normal @ light > 0.0, 1.0, 0.0)[:, None] * light


@pytest.mark.parametrize("angle_deg", [12.0, 20.0, 35.0])
def test_normals_between_receive_what_they_face(device: ComputeDevice, angle_deg: float) -> None:
    """From a distant lamp: exact up to the second derivative."""
    light = np.array([-0.3, 0.8, 0.5])
    light /= np.linalg.norm(light)
    tables, flux = lit_from(light)
    points, normals = surface_points(5000)
    lit = normals @ light > 0.3
    points, normals = points[lit], normals[lit]
    facing = turned(normals, np.deg2rad(angle_deg))
    found = looked_up(device, tables, points, facing, flux=flux)
    truth = np.maximum(facing @ light, 0.0)
    # E(n') = cos E + the part along n' - cos n; cos is taken as 1.
    bound = (1.0 - np.cos(np.deg2rad(angle_deg))) * (normals @ light)
    inside = truth > 0.25 * (normals @ light)
    inside &= far_from_edges(points)
    assert inside.sum() > 500
    np.testing.assert_array_less(np.abs(found - truth)[inside], bound[inside] + 1e-5)


def test_normals_of_one_surface_share_its_irradiance(device: ComputeDevice) -> None:
    """Bit for bit, so that a flux of few samples adds no noise."""
    tables = corner_tables(2.0, 2.0)
    flux = np.random.default_rng(5).normal(size=(32 * 64, 3))
    points, normals = surface_points(5000)
    facing = turned(normals, np.deg2rad(4.0))
    found = looked_up(device, tables, points, facing, flux=flux)
    np.testing.assert_array_equal(found, looked_up(device, tables, points, facing))


def test_irradiance_between_normals_is_bounded(device: ComputeDevice) -> None:
    """A flux of noise makes nothing black, and nothing glow."""
    tables = corner_tables(1.0, 1.0)
    flux = 1e4 * np.random.default_rng(5).normal(size=(32 * 64, 3))
    points, normals = surface_points(5000)
    found = looked_up(device, tables, points, turned(normals, 0.4), flux=flux)
    assert (found > 0.249).all()
    assert (found < 4.001).all()
    assert found.std() > 1.0
