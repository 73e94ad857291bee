"""Windows in the whole frame: distant light behind them enters the room with parallax."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.window_environment import outside_radiance
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.material import Material
from iprt.renderer import RenderedFrame
from iprt.settings.model import Settings
from tests.oracles.worlds import Sphere, World
from tests.rendering import render
from tests.worlds import Float, ball, panorama_at

pytestmark = pytest.mark.gl

ROOM = World()
FLOOR = ROOM.low[1]
WIDTH, HEIGHT = 512, 256
MIRROR = Material("conductor", (0.9, 0.8, 0.7), alpha=0.0)
BALL = Sphere((0.3, 0.1, 1.2), 0.4)
SUN = np.array([0.1, 0.32, -1.0]) / np.linalg.norm([0.1, 0.32, -1.0])
METHODS = ("environment", "surface")


def in_window(points: Float) -> NDArray[np.bool_]:
    """A wide window in the wall ahead."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.asarray((z < ROOM.low[2] + 1e-6) & (np.abs(x) < 1.5) & (y > -0.7) & (y < 1.1))


def sky(d: Float) -> Float:
    """Radiance from far away: bands of color."""
    return np.asarray(1.0 + 0.8 * np.sin(d * [40.0, 50.0, 9.0] + [0.0, 1.0, 2.0]))


def sun(d: Float) -> Float:
    """Radiance from far away: a disc of 10 degrees' radius."""
    disc = d @ SUN > np.cos(np.deg2rad(10.0))
    return np.asarray(np.where(disc, 40.0, 0.5)[..., None] * np.ones(3))


def windowed(light: Callable[[Float], Float]) -> Frame:
    """A grey room; its window shows `light` and has the depth of the wall."""
    d = View(WIDTH, HEIGHT, projection="equirect").directions()
    t, _, _ = ROOM.first_hit(np.zeros(3), d)
    opening = in_window(t[..., None] * d)
    color = np.where(opening[..., None], light(d), 0.2).astype(np.float32)
    return replace(ROOM.frame(WIDTH, HEIGHT), color=color, opening=opening)


def arriving(frame: Frame, openings: str, o: Float, d: Float) -> tuple[Float, NDArray[np.bool_]]:
    """Radiance along rays in the true room, and which of them go through the window."""
    t, _, _ = ROOM.first_hit(o, d)
    point = o + t[..., None] * d
    through = in_window(point)
    seen_at = panorama_at(frame.color, point / np.linalg.norm(point, axis=-1, keepdims=True))
    if openings == "surface":
        return seen_at, through
    column, row = np.moveaxis(equirect_pixel(d, WIDTH, HEIGHT).astype(int), -1, 0)
    known = frame.opening[row, column][..., None]
    hidden = panorama_at(outside_radiance(frame.color[frame.opening], frame.opening), d)
    beyond = np.where(known, panorama_at(frame.color, d), hidden)
    return np.where(through[..., None], beyond, seen_at), through


def render_ball(
    device: ComputeDevice, frame: Frame, solid: Sphere, view: View, openings: str, frames: int,
    rays: int = 1, **others: Any,
) -> RenderedFrame:  # fmt: skip
    trace = {"rays": rays, "openings": openings, "jitter": False}
    raw = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}
    sure = {"rows": 64, "rays": 256, "samples": 512}
    settings = Settings.model_validate({"trace": trace, "irradiance": sure, **raw, **others})
    objects = [ball(solid.centre, solid.radius, MIRROR, subdivisions=5)]
    return render(device, frame, objects, view, settings, frames)


@pytest.mark.thorough
@pytest.mark.parametrize("openings", METHODS)
def test_a_mirror_shows_what_is_behind_the_window(device: ComputeDevice, openings: str) -> None:
    """In the ray's own direction; or painted on the pane, seen from the ball."""
    frame, view = windowed(sky), View(128, 128, yaw_deg=166.0, pitch_deg=4.0, fov_y_deg=40.0)
    few = {"rows": 16}  # a mirror shows no irradiance
    picture = render_ball(device, frame, BALL, view, openings, 1, irradiance=few)
    d = view.directions()
    t, _, normal, _ = BALL.interval(np.zeros_like(d), d)
    met = np.isfinite(t) & (picture.aovs["coverage"] == 1.0)
    point = np.where(met, t, 0.0)[..., None] * d
    away = d - 2.0 * (d * normal).sum(-1, keepdims=True) * normal
    wanted, through = arriving(frame, openings, point, away)
    other, _ = arriving(frame, next(m for m in METHODS if m != openings), point, away)
    inner = met & through & (-(normal * d).sum(-1) > 0.5)
    for step in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        inner &= np.roll(through & met, step, (0, 1))
    assert inner.sum() > 200
    wanted, other = wanted[inner] * MIRROR.albedo, other[inner] * MIRROR.albedo
    error = np.abs(picture.color[inner] - wanted).max(-1)
    assert np.median(error) < 0.02
    assert (error < 0.06).mean() > 0.95
    # The two would not be confused.
    assert np.median(np.abs(wanted - other).max(-1)) > 0.3


@pytest.mark.thorough
@pytest.mark.parametrize("openings", METHODS)
def test_the_sun_falls_through_the_window(device: ComputeDevice, openings: str) -> None:
    """Onto the floor, as by Monte Carlo in the true room: twice the light of a painted pane."""
    frame = windowed(sun)
    view = View(36, 36, pitch_deg=-90.0, fov_y_deg=88.0)
    aside = Sphere((-1.7, 0.5, 0.0), 0.2)
    picture = render_ball(device, frame, aside, view, openings, 16, rays=32)
    x, z = np.array([[-0.4, 0.5], [0.0, 0.9], [0.5, 0.4], [0.4, -0.9], [-0.5, -1.1]]).T
    points = np.stack([x, np.full_like(x, FLOOR), z], -1)
    column, row = np.floor(view.project(points)).astype(int).T
    d = view.directions()[row, column]
    points = d * (FLOOR / d[:, 1:2])
    rng = np.random.default_rng(2)
    wanted = []
    for point in points:
        w = rng.normal(size=(100_000, 3))
        w = w / np.linalg.norm(w, axis=-1, keepdims=True) + [0.0, 1.0, 0.0]
        w /= np.linalg.norm(w, axis=-1, keepdims=True)
        wanted.append(arriving(frame, openings, point + np.array([0.0, 1e-6, 0.0]), w)[0].mean())
    irradiance = picture.aovs["irradiance_real"].mean(-1)
    shown = np.array([irradiance[r - 1 : r + 2, c - 1 : c + 2].mean()
                      for r, c in zip(row, column, strict=True)])  # fmt: skip
    np.testing.assert_allclose(shown, wanted, rtol=0.15)
