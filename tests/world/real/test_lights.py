"""Light sampling: the table, directions with the density that is stated, MIS without bias."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.world.real.lights import Lights
from tests.frame.test_windows import sun, windowed
from tests.kernels.wrap import evaluate
from tests.oracles.light import cell_luminance, light_density
from tests.oracles.worlds import Box, World, frame_of
from tests.world.real.lighting import RealWorld, numbers, uploaded
from tests.world.real.sphere import agreement
from tests.worlds import Float, bright_walls, ceiling_lamp, landscape_frame, room_frame

PILLAR = Box((-0.8, -0.4, -1.5), (0.25, 1.0, 0.2))
ROOM = World(solids=(PILLAR,))


# The table -----------------------------------------------------------------------------------


def random_panorama(width: int, height: int) -> NDArray[np.float32]:
    rng = np.random.default_rng(width)
    return rng.gamma(0.3, 2.0, (height, width, 3)).astype(np.float32)


def loaded(device: ComputeDevice, color: NDArray[np.float32]) -> Lights:
    lights = Lights(device, color.shape[1], color.shape[0])
    lights.load(uploaded(device, color))
    return lights


def shine(device: ComputeDevice, lights: Lights) -> bool:
    """Whether anything is aimed at."""
    return bool(device.read(lights.arguments().column)[-1] > 0.0)


@pytest.mark.parametrize("size", [(32, 16), (40, 30), (1030, 520)], ids=str)
def test_table_equals_a_plain_one(device: ComputeDevice, size: tuple[int, int]) -> None:
    """Marginal and conditional distributions of a density that NumPy computes in float64."""
    color = random_panorama(*size)
    table = loaded(device, color).arguments()
    rows, columns = table.rows, table.columns
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    solid_angle = (edges[:-1] - edges[1:])[:, None] * 2.0 * np.pi / columns
    wanted = light_density(cell_luminance(color, rows, columns))
    light = wanted * solid_angle
    assert light.sum() == pytest.approx(1.0)
    found = device.read(table.density).reshape(rows, columns)
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-5 * wanted.max())
    column = device.read(table.column)
    of_columns = np.concatenate([[0.0], np.cumsum(light.sum(axis=0))])
    np.testing.assert_allclose(column, of_columns, atol=1e-5)
    share = device.read(table.share).reshape(rows, columns)
    with np.errstate(invalid="ignore"):
        down = np.nan_to_num(np.cumsum(light, axis=0) / light.sum(axis=0))
    np.testing.assert_allclose(share, down, atol=1e-4)
    assert (column[0], column[-1]) == (0.0, 1.0)
    assert set(share[-1]) <= {0.0, 1.0}
    assert (np.diff(column) >= 0.0).all()
    assert (np.diff(share, axis=0) >= 0.0).all()


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_unit_of_light_does_not_matter(device: ComputeDevice, unit: float) -> None:
    color = random_panorama(64, 32)
    tables = [loaded(device, np.float32(scale) * color).arguments() for scale in (1.0, unit)]
    for name in ("density", "column", "share"):
        found, wanted = (device.read(getattr(table, name)) for table in tables)
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-5 * wanted.max())


@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_nothing_is_aimed_at_in_even_light(device: ComputeDevice, noise: float) -> None:
    rng = np.random.default_rng(0)
    color = (3.0 * (1.0 + noise * rng.random((256, 512, 3)))).astype(np.float32)
    lights = loaded(device, color)
    assert not shine(device, lights)
    assert not device.read(lights.arguments().density).any()
    lights.load(uploaded(device, np.zeros_like(color)))
    assert not shine(device, lights)
    lights.load(uploaded(device, random_panorama(512, 256)))
    assert shine(device, lights)


def test_directions_follow_the_table(device: ComputeDevice) -> None:
    """Also within cells: each is cut into four."""
    color = random_panorama(32, 16)
    lights = loaded(device, color)
    count = 1 << 18
    v = evaluate(
        device,
        ["world/real/lights.h"],
        "v = sample_light(lights, u);",
        {"u": numbers(1, count, 2)},
        {"v": "float3"},
        parameters="const Lights lights",
        arguments={"lights": lights.arguments()},
    )["v"].astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(v, axis=1), 1.0, atol=1e-6)
    column, row = np.floor(equirect_pixel(v, 64, 32)).astype(int).T
    counts = np.zeros((32, 64))
    np.add.at(counts, (np.clip(row, 0, 31), column % 64), 1.0)
    edges = np.cos(np.arange(33) / 32.0 * np.pi)
    solid_angle = (edges[:-1] - edges[1:])[:, None] * (2.0 * np.pi / 64)
    density = light_density(cell_luminance(color, 16, 32)).repeat(2, 0).repeat(2, 1)
    expected = density * solid_angle * count
    assert counts[expected == 0.0].sum() <= 1e-4 * count  # rounded over an edge
    kept = expected > 10.0
    assert kept.sum() > 300
    statistic = ((counts - expected) ** 2 / np.maximum(expected, 1e-9))[kept].sum()
    assert chi2.sf(statistic, kept.sum() - 1) > 0.01


# Seen from elsewhere -------------------------------------------------------------------------


def sunny_landscape() -> Frame:
    frame = landscape_frame(256, 128)
    d = View(256, 128, projection="equirect").directions()
    disc = d @ (np.array([0.5, 0.6, -0.4]) / np.linalg.norm([0.5, 0.6, -0.4])) > 0.97
    return replace(frame, color=np.where(disc[..., None], 30.0, frame.color).astype(np.float32))


def shining_pillar(points: Float, normals: Float) -> Float:
    """Light comes from a pillar, which hides some of it from most places."""
    near = (np.abs(points - PILLAR.centre) < np.array(PILLAR.half) + 1e-3).all(-1)
    return np.asarray(np.where(near, 5.0, 0.5)[..., None] * np.ones(3))


def sky_alone() -> Frame:
    frame = frame_of(np.full((64, 128), np.inf))
    return replace(frame, color=random_panorama(128, 64))


BLIND = Box((0.04, 0.25, -0.27), (0.14, 0.01, 0.14))
"""It comes between the capture centre and most of the ceiling's lamp."""


def lamp_behind_a_blind() -> Frame:
    frame = room_frame(World(solids=(PILLAR, BLIND)), 256, 128, ceiling_lamp)
    hides = frame.depth < room_frame(ROOM, 256, 128, ceiling_lamp).depth
    return replace(frame, color=np.where(hides[..., None], 0.4, frame.color).astype(np.float32))


FRAMES: dict[str, Callable[[], Frame]] = {
    "lamp": lambda: room_frame(ROOM, 256, 128, ceiling_lamp),
    "bright walls": lambda: room_frame(ROOM, 256, 128, bright_walls),
    "pillar": lambda: room_frame(ROOM, 256, 128, shining_pillar),
    "window": lambda: windowed(sun),
    "sun": sunny_landscape,
    "sky": sky_alone,
    "remembered lamp": lamp_behind_a_blind,
}
BEFORE = {"remembered lamp": lambda: room_frame(ROOM, 256, 128, ceiling_lamp)}
"""What was seen before the frame and is remembered behind it."""
PLACES = [(0.2, -1.2, -0.9), (-1.6, 0.2, -0.6)]
CASES = [(name, place) for name in FRAMES for place in PLACES]
ŠIDÁK = 1.0 - (1.0 - 0.01) ** (1.0 / len(CASES))
"""Right samplers are rejected once in 100 sets of samples, over all cases together."""

DRAW = """
const float3 v = sample_light(world.lights, u);
const int texel = texel_towards(world.real, v);
d = towards_light(world.real, v, texel, x);
const RealHit hit = trace_real_layer(world.real, x, d, INFINITY);
counts = hit.texel == texel
    && light_density(world.lights, world.real, hit, d) > 0.0f;
"""
STATE = """
const RealHit hit = trace_real_layer(world.real, x, d, INFINITY);
density = light_density(world.lights, world.real, hit, d);
"""


@pytest.fixture(scope="module")
def worlds(device: ComputeDevice) -> Callable[[str], RealWorld]:
    made: dict[str, RealWorld] = {}

    def world(name: str) -> RealWorld:
        if name not in made:
            before = BEFORE[name]() if name in BEFORE else None
            made[name] = RealWorld(device, FRAMES[name](), before=before)
        return made[name]

    return world


def repeated(place: Sequence[float], count: int) -> NDArray[np.float32]:
    return np.tile(np.asarray(place, np.float32), (count, 1))


@pytest.mark.parametrize(("name", "place"), CASES)
def test_directions_to_lights_have_their_density(
    worlds: Callable[[str], RealWorld], name: str, place: tuple[float, float, float]
) -> None:
    """Directions that do not reach their light form one more bin, the hidden share."""
    world, count = worlds(name), 1 << 16
    u = numbers(CASES.index((name, place)), count, 2)
    drawn = world.run(DRAW, {"x": repeated(place, count), "u": u}, {"d": "float3", "counts": "int"})
    reached = drawn["d"][drawn["counts"] > 0]

    def stated(d: NDArray[np.float32]) -> NDArray[np.float32]:
        inputs = {"x": repeated(place, len(d)), "d": d}
        return np.asarray(world.run(STATE, inputs, {"density": "float"})["density"])

    assert agreement(reached, count, stated) > ŠIDÁK
    if name in ("sun", "sky", "remembered lamp"):  # nothing is in the way
        assert len(reached) > 0.999 * count
    else:
        assert len(reached) > 0.1 * count
