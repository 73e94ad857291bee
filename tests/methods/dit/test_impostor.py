"""The distance impostor: splatting, filling of holes, intersection with rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.equirect import equirect_pixel
from iprt.methods.dit.impostor import Impostor
from iprt.settings.trace import TraceSettings
from iprt.world.real.panorama import Panorama
from tests.kernels.tracing import SKY, SURFACE, panorama_of, random_directions
from tests.kernels.wrap import evaluate
from tests.oracles.worlds import Box, World
from tests.worlds import (
    Float,
    bright_walls,
    ceiling_lamp,
    landscape_frame,
    room_frame,
    sphere_frame,
)

ROOM = World()
CENTRE = (0.5, -0.7, -0.9)


def placed(
    device: ComputeDevice,
    panorama: Panorama,
    centre: Sequence[float] = CENTRE,
    *,
    side: int = 24,
    steps: int = 4,
    lights: bool = False,
) -> Impostor:
    impostor = Impostor(device, side, steps, light_sampling=lights)
    impostor.place(panorama, np.array(centre))
    return impostor


def faces(device: ComputeDevice, impostor: Impostor, side: int) -> Float:
    """(6, side, side, 4) radiance and inverse distance."""
    texels = device.read(impostor.texels)[: 6 * side * side]
    return np.asarray(texels.reshape(6, side, side, 4), np.float64)


def texel_directions(side: int) -> Float:
    """(6, side, side, 3) through the centres of texels."""
    across = (2.0 * np.arange(side) + 1.0) / side - 1.0
    d = np.zeros((6, side, side, 3))
    for face in range(6):
        axis = face // 2
        d[face, ..., axis] = 1.0 if face % 2 == 0 else -1.0
        d[face, ..., (axis + 1) % 3] = across
        d[face, ..., (axis + 2) % 3] = across[:, None]
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))


# The map -------------------------------------------------------------------------------------


def met_by_brute_force(surface: Float, centre: Float, d: Float) -> tuple[Float, Float]:
    """(N,) inverse distances along d (N, 3) to the nearest and farthest of all tangent planes
    (H, W, 4), each in its texel alone; -1: none.
    """
    height, width = surface.shape[:2]
    g = surface.reshape(-1, 4)[:, :3]
    found, last = np.full((2, len(d)), -1.0)
    for i, w in enumerate(d):
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = (g @ w) / (1.0 - g @ centre)
            points = centre + w / inverse[:, None]
            v = points / np.linalg.norm(points, axis=1, keepdims=True)
        column, row = np.moveaxis(np.floor(equirect_pixel(v, width, height)), -1, 0)
        own = np.minimum(row, height - 1) * width + column % width == np.arange(height * width)
        own &= (inverse > 0.0) & ((points * g).sum(1) > 0.0)
        if own.any():
            found[i], last[i] = inverse[own].max(), inverse[own].min()
    return found, last


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_nearest_surface_wins(device: ComputeDevice, up: float) -> None:
    """Seen from above the hidden surfaces, or from below."""
    centre = (CENTRE[0], up * CENTRE[1], CENTRE[2])
    world = World(solids=(Box((-0.8, -0.4 * up, -1.5), (0.25, 1.0, 0.2)),))
    side, frame = 14, world.frame(64, 32)
    depth = np.repeat(frame.depth[..., None], 3, -1)
    panorama = panorama_of(device, replace(frame, color=depth))
    with mock.patch.object(Impostor, "fill"):
        texels = faces(device, placed(device, panorama, centre, side=side), side).reshape(-1, 4)
    found = texels[:, 3]
    surface = device.read(panorama.surface).astype(np.float64)
    d = texel_directions(side).reshape(-1, 3)
    wanted, last = met_by_brute_force(surface, np.array(centre), d)
    # Behind the pillar nothing was seen.
    assert 10 < (wanted < 0.0).sum() < 200
    # Rows of the panorama are curved, and outlines of texels straight.
    assert ((found < 0.0) == (wanted < 0.0)).mean() > 0.97
    both = (found > 0.0) & (wanted > 0.0)
    same = np.abs(found[both] / wanted[both] - 1.0) < 1e-3
    assert same.mean() > 0.97
    hiding = wanted[both] > 1.1 * last[both]
    assert hiding.sum() > 5
    assert same[hiding].mean() > 0.9
    # Its color is its own: here, how far it is from the camera.
    seen = np.linalg.norm(np.array(centre) + d[both] / wanted[both][:, None], axis=1)
    off = np.abs(texels[both, 0] / seen - 1.0)
    assert np.quantile(off[hiding], 0.7) < 0.05


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), CENTRE, (-1.4, 1.0, 2.2)])
def test_a_room_has_its_distances_and_colors(
    device: ComputeDevice, centre: tuple[float, float, float]
) -> None:
    """A convex room is visible from everywhere."""
    side = 32
    panorama = panorama_of(device, room_frame(ROOM, 256, 128, bright_walls))
    found = faces(device, placed(device, panorama, centre, side=side), side)
    d = texel_directions(side)
    t, normal, _ = ROOM.first_hit(np.array(centre), d)
    assert np.quantile(np.abs(found[..., 3] * t - 1.0), 0.95) < 1e-3
    wanted = bright_walls(np.array(centre) + t[..., None] * d, normal)
    apart = np.abs(found[..., :3] - wanted).max(-1)
    assert np.quantile(apart, 0.9) < 0.02
    assert (found[..., 3] > 0.0).all()


def test_small_lights_keep_their_flux(device: ComputeDevice) -> None:
    """A lamp of few texels of the impostor, and many of the panorama."""
    side = 16
    frame = room_frame(ROOM, 512, 256, ceiling_lamp)
    found = faces(device, placed(device, panorama_of(device, frame), side=side), side)
    d = texel_directions(side)
    fine = np.random.default_rng(0).normal(size=(400_000, 3))
    fine /= np.linalg.norm(fine, axis=1, keepdims=True)
    t, normal, _ = ROOM.first_hit(np.array(CENTRE), fine)
    wanted = ceiling_lamp(np.array(CENTRE) + t[..., None] * fine, normal).mean()
    solid_angle = (np.abs(d).max(-1)) ** 3
    mean = (found[..., 0] * solid_angle).sum() / solid_angle.sum()
    assert mean == pytest.approx(wanted, rel=0.02)


def test_rays_are_aimed_at_the_lamp_from_the_centre(device: ComputeDevice) -> None:
    panorama = panorama_of(device, room_frame(ROOM, 256, 128, ceiling_lamp))
    lights = placed(device, panorama, side=64, lights=True).lights
    assert lights is not None
    d = texel_directions(64).reshape(-1, 3)
    column, row = np.moveaxis(equirect_pixel(d, lights.columns, lights.rows), -1, 0)
    cell = row.astype(int) * lights.columns + column.astype(int) % lights.columns
    density = device.read(lights.arguments().density).ravel()[cell]
    t, normal, _ = ROOM.first_hit(np.array(CENTRE), d)
    lit = ceiling_lamp(np.array(CENTRE) + t[..., None] * d, normal)[:, 0] > 1.0
    assert ((density > 0.0) == lit).mean() > 0.98
    assert (density[lit] > 0.0).mean() > 0.9


# Holes ---------------------------------------------------------------------------------------


def filled(texels: Float) -> Float:
    """(6, n, n, 4): holes, where w < 0, by push-pull."""
    n = texels.shape[1]
    known = texels[..., 3] >= 0.0
    if n == 1:
        return np.where(known[..., None], texels, texels[known].mean(0))
    m = (n + 1) // 2
    coarse = np.zeros((6, m, m, 4))
    for face, row, column in np.ndindex(6, m, m):
        here = np.s_[face, 2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
        of = texels[here][known[here]]
        coarse[face, row, column] = of.mean(0) if len(of) else (0.0, 0.0, 0.0, -1.0)
    coarse = filled(coarse)
    result = texels.copy()
    for face, row, column in np.argwhere(~known):
        blend = np.zeros(4)
        line, across = row / 2.0 - 0.25, column / 2.0 - 0.25
        low_row, low_column = int(np.floor(line)), int(np.floor(across))
        for i, j in np.ndindex(2, 2):
            weight = abs(1 - i - (line - low_row)) * abs(1 - j - (across - low_column))
            at = np.clip([low_row + i, low_column + j], 0, m - 1)
            blend += weight * coarse[face, at[0], at[1]]
        result[face, row, column] = blend
    return result


@pytest.mark.parametrize("side", [8, 13])
def test_holes_are_filled_by_push_pull(device: ComputeDevice, side: int) -> None:
    rng = np.random.default_rng(side)
    impostor = Impostor(device, side, 1, light_sampling=False)
    texels = np.zeros(impostor.texels.shape, np.float32)
    level = texels[: 6 * side * side]
    level[:] = rng.random(level.shape) + 0.1
    level[rng.random(len(level)) < 0.7] = (0.0, 0.0, 0.0, -1.0)
    level.reshape(6, -1, 4)[2] = (0.0, 0.0, 0.0, -1.0)
    device.write(impostor.texels, texels)
    impostor.fill()
    wanted = filled(level.reshape(6, side, side, 4).astype(np.float64))
    np.testing.assert_allclose(faces(device, impostor, side), wanted, rtol=1e-5)
    inverse = device.read(impostor.inverse).reshape(6, side, side)
    np.testing.assert_allclose(inverse, wanted[..., 3], rtol=1e-5)


def test_where_nothing_is_known_there_is_a_black_sky(device: ComputeDevice) -> None:
    impostor = Impostor(device, 8, 1, light_sampling=False)
    texels = np.zeros(impostor.texels.shape, np.float32)
    texels[:, 3] = -1.0
    device.write(impostor.texels, texels)
    impostor.fill()
    np.testing.assert_array_equal(faces(device, impostor, 8), 0.0)


# Rays ----------------------------------------------------------------------------------------


def traced(
    device: ComputeDevice, panorama: Panorama, impostor: Impostor, o: Float, d: Float
) -> tuple[Float, Float, Float]:
    """Distances (N,), kinds (N,), and points (N, 3) about the impostor's centre."""
    layer = replace(panorama.arguments(TraceSettings()), impostor=impostor.arguments())
    found = evaluate(
        device,
        ["world/real/real.h"],
        "RealHit hit = trace_real_layer(layer, o, d, INFINITY);"
        "t = hit.t; kind = hit.kind; p = hit.direction;",
        {"o": o.astype(np.float32), "d": d.astype(np.float32)},
        {"t": "float", "kind": "int", "p": "float3"},
        defines=["IMPOSTOR"],
        parameters="const RealLayer layer",
        arguments={"layer": layer},
    )
    return found["t"], found["kind"], found["p"]


def starts(count: int) -> tuple[Float, Float]:
    """Rays from around the middle of things, in all directions."""
    rng = np.random.default_rng(5)
    return np.array(CENTRE) + rng.uniform(-0.45, 0.45, (count, 3)), random_directions(rng, count)


def sphere_distance(o: Float, d: Float) -> Float:
    """To the inside of a sphere of radius 2 about the capture centre."""
    along = (o * d).sum(1)
    return np.asarray(-along + np.sqrt(along**2 - (o * o).sum(1) + 4.0))


def room_distance(o: Float, d: Float) -> Float:
    return ROOM.first_hit(o, d)[0]


@pytest.mark.thorough
@pytest.mark.parametrize("of", ["sphere", "room"])
def test_refinement_converges_to_what_a_ray_meets(device: ComputeDevice, of: str) -> None:
    frame = (
        sphere_frame(2.0, 512, 256, 1.0)
        if of == "sphere"
        else room_frame(ROOM, 512, 256, bright_walls)
    )
    panorama = panorama_of(device, frame)
    o, d = starts(4000)
    true = (sphere_distance if of == "sphere" else room_distance)(o, d)
    errors = []
    for steps in (0, 1, 2, 4, 8, 16):
        impostor = placed(device, panorama, side=256, steps=steps)
        t, kind, p = traced(device, panorama, impostor, o, d)
        assert (kind == SURFACE).all()
        np.testing.assert_allclose(p, o - CENTRE + t[:, None] * d, atol=1e-4)
        errors.append(np.quantile(np.abs(t / true - 1.0), 0.8))
    for before, after in pairwise(errors[:4]):
        assert after < 0.7 * before
    assert max(errors[3:]) < 1e-3


def test_the_first_guess_is_right_on_a_wall_across_the_ray(device: ComputeDevice) -> None:
    panorama = panorama_of(device, room_frame(ROOM, 512, 256, bright_walls))
    o, _ = starts(200)
    d = np.broadcast_to([0.0, 0.0, -1.0], o.shape)
    t, _, _ = traced(device, panorama, placed(device, panorama, side=64, steps=0), o, d)
    np.testing.assert_allclose(t, room_distance(o, d), rtol=2e-3)


def test_open_sky_is_infinitely_far(device: ComputeDevice) -> None:
    panorama = panorama_of(device, landscape_frame(256, 128))
    o, d = starts(4000)
    impostor = placed(device, panorama, side=128, steps=8)
    t, kind, p = traced(device, panorama, impostor, o, d)
    up, down = d[:, 1] > 0.05, d[:, 1] < -0.1
    assert (kind[up] == SKY).all()
    assert np.isinf(t[up]).all()
    towards = p / np.linalg.norm(p, axis=1, keepdims=True)
    assert ((towards * d).sum(1)[up] > 1.0 - 1e-4).all()
    assert (kind[down] == SURFACE).all()
    plain = (-1.5 - o[down, 1]) / d[down, 1]
    assert np.quantile(np.abs(t[down] / plain - 1.0), 0.9) < 0.01
