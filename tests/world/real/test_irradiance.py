"""The irradiance cache: its values are true; it keeps and forgets at the right time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.frame.test_windows import arriving, sun, windowed
from tests.oracles.worlds import Box, Sphere, World
from tests.worlds import Float, ball, ceiling_lamp, panorama_at, room_frame

pytestmark = pytest.mark.gl

ROOM = World()
FLOOR = ROOM.low[1]
BALL = Sphere((0.2, FLOOR + 0.35, -1.4), 0.3)
DOWN = View(48, 36, pitch_deg=-35.0)
ROWS = 32


def renderer(
    device: ComputeDevice,
    frame: Frame,
    view: View = DOWN,
    objects: list[Instance] | None = None,
    light_sampling: bool = True,
    relit: bool = False,
    **irradiance: int,
) -> Renderer:
    chosen = {
        "fading": 0.0,
        "mask": {"sparse": False},
        "irradiance": {"rows": ROWS, **irradiance},
        "trace": {"light_sampling": light_sampling},
        "iprt": {"relight_reflections": relit},
    }
    there = objects or [ball(BALL.centre, BALL.radius, Material(albedo=(0.0, 0.0, 0.0)))]
    return Renderer(device, frame, there, view, Settings.model_validate(chosen))


def cells(made: Renderer) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """(N, 4) plane, mean and smoothed irradiance of the surfaces at the cells' centres."""
    cache = made.real_world.irradiance
    assert cache is not None
    plane, mean, smooth = (
        made.device.read(grid)[: 2 * ROWS * ROWS]
        for grid in (cache.plane, cache.mean, cache.irradiance)
    )
    return plane, mean, smooth


def fluxes(made: Renderer) -> tuple[NDArray[Any], NDArray[Any]]:
    """(N, 3) flux of the same surfaces, of the mean and of the smoothed irradiance."""
    cache = made.real_world.irradiance
    assert cache is not None
    mean, smooth = (
        made.device.read(grid)[len(grid) // 2 :][: 2 * ROWS * ROWS, :3]
        for grid in (cache.mean, cache.irradiance)
    )
    return mean, smooth


def unit(vectors: Float) -> Float:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def cell_directions() -> Float:
    return View(2 * ROWS, ROWS, projection="equirect").directions().reshape(-1, 3)


def lamp_frame() -> Frame:
    return room_frame(ROOM, 256, 128, ceiling_lamp)


# True ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("light_sampling", [False, True], ids=["even", "aimed"])
@pytest.mark.parametrize("scene", ["lamp", "window"])
def test_cells_hold_the_irradiance(device: ComputeDevice, scene: str, light_sampling: bool) -> None:
    """Cell by cell, and all together, within the errors of both: float64 Monte Carlo."""
    frame = lamp_frame() if scene == "lamp" else windowed(sun)
    samples, count = 1024, 8_000
    with renderer(
        device, frame, light_sampling=light_sampling, rays=samples // 2, samples=samples
    ) as made:
        made.render(1)
        plane, mean, _ = cells(made)
    known = np.flatnonzero(mean[:, 3] > 0.0)
    assert len(known) > 60
    assert (mean[known, 3] == samples).all()
    # Apart from edges, where a texel shows one wall and its tangent plane goes on.
    v, g = cell_directions(), plane[:, :3].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        gaps = np.minimum(
            v / (g * v).sum(-1, keepdims=True) - ROOM.low,
            np.asarray(ROOM.high) - v / (g * v).sum(-1, keepdims=True),
        )
    known = known[np.sort(gaps, axis=-1)[known, 1] > 0.15]
    rng = np.random.default_rng(3)
    known = rng.choice(known, 40, replace=False)
    lift = 2.0 * np.pi / frame.height
    apart, errors = [], []
    for cell in known:
        v, g = cell_directions()[cell], plane[cell, :3].astype(np.float64)
        n = -g / np.linalg.norm(g)
        p = v / (g @ v)
        o = p + lift * np.linalg.norm(p) * n
        w = rng.normal(size=(count, 3))
        w = n + w / np.linalg.norm(w, axis=1, keepdims=True)
        w /= np.linalg.norm(w, axis=1, keepdims=True)
        if scene == "lamp":
            reach = ROOM.first_hit(o, w)[0]
            light = panorama_at(frame.color, o + reach[:, None] * w)[:, 1]
        else:
            light = arriving(frame, "environment", np.broadcast_to(o, w.shape), w)[0][:, 1]
        # Light sampling is no noisier than this where it pays.
        spread = light.std() * (2.0 if light_sampling and scene == "window" else 1.0)
        apart.append(mean[cell, 1] - light.mean())
        noise = np.hypot(light.std() / np.sqrt(count), spread / np.sqrt(samples))
        # Rooms of texels are a little off the true one.
        errors.append(np.hypot(noise, 0.01 * light.mean()))
    z = np.array(apart) / np.array(errors)
    assert np.abs(z).max() < norm.isf(0.5 * (1.0 - 0.99 ** (1.0 / len(z))))
    total = np.sum(apart) / np.sqrt(np.sum(np.square(errors)))
    assert abs(total) < norm.isf(0.005)


def test_sides_narrower_than_cells_have_an_irradiance_of_their_own(device: ComputeDevice) -> None:
    """The front of a book on the floor: float64 Monte Carlo, and not what its top receives."""
    front, top = -1.3, FLOOR + 0.1
    world = World(solids=(Box((0.0, FLOOR + 0.05, front - 0.3), (0.5, 0.05, 0.3)),))
    frame = room_frame(world, 512, 256, ceiling_lamp)
    pitch_deg = float(np.degrees(np.arctan2(FLOOR + 0.05, -front)))
    view = View(48, 36, pitch_deg=pitch_deg, fov_y_deg=12.0)
    black = Material(albedo=(0.0, 0.0, 0.0))
    objects = [ball((0.9, FLOOR + 0.35, front + 0.3), 0.3, black)]
    with renderer(device, frame, view, objects, rays=256, samples=1024) as made:
        shown = made.render(6, ("irradiance_real",)).aovs["irradiance_real"][..., 1]
    reach, normal, _ = world.first_hit(np.zeros(3), view.directions())
    points = reach[..., None] * view.directions()
    on_front = (normal[..., 2] > 0.5) & (np.abs(points[..., 0]) < 0.4)
    on_front &= (points[..., 1] > FLOOR + 0.02) & (points[..., 1] < top - 0.02)
    assert on_front.sum() > 150
    rng = np.random.default_rng(1)
    ratios = []
    for p in rng.choice(points[on_front], 24):
        n = np.array((0.0, 0.0, 1.0))
        w = n + unit(rng.normal(size=(8000, 3)))
        w /= np.linalg.norm(w, axis=1, keepdims=True)
        o = p + 1e-4 * n
        light = panorama_at(frame.color, o + world.first_hit(o, w)[0][:, None] * w)[:, 1].mean()
        row, column = np.argwhere((points == p).all(-1))[0]
        ratios.append(shown[row, column] / light)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    assert np.std(ratios) < 0.2


# Where it is needed --------------------------------------------------------------------------


def test_only_what_is_looked_at_is_refined(device: ComputeDevice) -> None:
    with renderer(device, lamp_frame()) as made:
        made.render(3)
        _, mean, _ = cells(made)
        d = cell_directions()
        with np.errstate(divide="ignore", invalid="ignore"):
            column, row = np.moveaxis(DOWN.project(d), -1, 0)
        ahead = d @ DOWN.directions()[18, 24] > 0.2
        inside = ahead & (column > 0) & (column < 48) & (row > 0) & (row < 36)
        assert (mean[inside, 3] > 0.0).mean() > 0.9
        far = d @ DOWN.directions()[18, 24] < 0.3
        assert not mean[far, 3].any()


def test_cells_are_refined_until_enough(device: ComputeDevice) -> None:
    """And only where objects have influence; a few rays do elsewhere."""
    with renderer(device, lamp_frame(), rays=16, samples=100) as made:
        made.render(24)
        _, mean, _ = cells(made)
    samples = mean[:, 3]
    assert set(np.unique(samples)) >= {0.0, 32.0}
    assert 100.0 <= samples.max() < 116.0
    assert (samples[(samples > 0.0)] >= 32.0).all()


# Over time -----------------------------------------------------------------------------------


def test_the_same_video_keeps_all(device: ComputeDevice) -> None:
    frame = lamp_frame()
    with renderer(device, frame) as made:
        made.render(4)
        before = cells(made)
        made.load(frame)
        made.load(replace(frame, color=frame.color.copy()))
        for old, new in zip(before, cells(made), strict=True):
            np.testing.assert_array_equal(old, new)


@pytest.mark.parametrize("factor", [0.8, 0.5])
def test_light_is_followed_and_doubted_in_proportion(device: ComputeDevice, factor: float) -> None:
    """Dimmed as a whole: so is E_R, which is as sure as half of the change is small."""
    frame = lamp_frame()
    with renderer(device, frame, rays=32) as made:
        made.render(2)
        before = cells(made)
        flux_before = fluxes(made)
        assert before[1][:, 3].max() >= 64.0
        made.load(replace(frame, color=frame.color * np.float32(factor)))
        after, flux_after = cells(made), fluxes(made)
    known = before[1][:, 3] > 0.0
    for old, new in zip(before[1:], after[1:], strict=True):
        np.testing.assert_allclose(new[known, :3], factor * old[known, :3], rtol=0.06)
    for old, new in zip(flux_before, flux_after, strict=True):
        np.testing.assert_allclose(new[known], factor * old[known], rtol=0.06)
    kept = 1.0 / (0.5 * np.log(factor)) ** 2
    np.testing.assert_allclose(after[1][:, 3], np.minimum(before[1][:, 3], kept), rtol=0.1)


def test_local_shadows_are_followed_locally(device: ComputeDevice) -> None:
    """A shadow on the floor, of a thing out of sight: E_R falls there as the floor darkens."""
    frame = lamp_frame()
    d = View(256, 128, projection="equirect").directions()
    t, normal, _ = ROOM.first_hit(np.zeros(3), d)
    point = t[..., None] * d
    shadow = (np.abs(point[..., 0] - 0.5) < 0.5) & (np.abs(point[..., 2] + 1.5) < 0.5)
    shadow &= normal[..., 1] > 0.5
    darker = np.where(shadow[..., None], np.float32(0.6), np.float32(1.0)) * frame.color
    with renderer(device, frame) as made:
        made.render(4)
        before = cells(made)[1]
        made.load(replace(frame, color=darker))
        after = cells(made)[1]
    known = before[:, 3] > 0.0
    share = shadow.reshape(ROWS, 4, 2 * ROWS, 4).mean((1, 3)).ravel()
    inside, outside = known & (share == 1.0), known & (share == 0.0)
    assert inside.sum() > 5
    np.testing.assert_allclose(after[inside, :3], 0.6 * before[inside, :3], rtol=0.05)
    np.testing.assert_array_equal(after[outside], before[outside])


def test_what_moved_is_forgotten(device: ComputeDevice) -> None:
    """A step in the floor, and nothing else."""
    frame = lamp_frame()
    d = View(256, 128, projection="equirect").directions()
    t, normal, _ = ROOM.first_hit(np.zeros(3), d)
    point = t[..., None] * d
    step = (np.abs(point[..., 0] - 0.7) < 0.4) & (np.abs(point[..., 2] + 1.5) < 0.4)
    step &= normal[..., 1] > 0.5
    depth = np.where(step, frame.depth * np.float32(0.8), frame.depth)
    with renderer(device, frame) as made:
        made.render(4)
        plane, mean, smooth = cells(made)
        made.load(replace(frame, depth=depth.astype(np.float32)))
        plane_now, mean_now, smooth_now = cells(made)
    column, row = np.floor(equirect_pixel(cell_directions(), 256, 128)).astype(int).T
    moved = step[row, column]
    known = mean[:, 3] > 0.0
    assert (moved & known).sum() > 5
    assert not mean_now[moved, 3].any()
    assert not smooth_now[moved, 3].any()
    np.testing.assert_array_equal(mean_now[~moved], mean[~moved])
    np.testing.assert_array_equal(smooth_now[~moved], smooth[~moved])
    np.testing.assert_array_equal(plane_now[~moved], plane[~moved])
