"""Memory of surfaces behind moving things, in the whole frame."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.oracles.worlds import Box, Sphere, World
from tests.worlds import Float, ball, bright_walls, room_frame

SCREEN = Box((0.45, -0.2, -0.9), (0.3, 0.35, 0.01))
"""A real thing, which stands before the mirror ball's surroundings."""
BALL = Sphere((-0.45, -0.1, -1.2), 0.3)
SILVER = Material("conductor", (0.9, 0.9, 0.9), alpha=0.0)
MIRROR = ball(BALL.centre, BALL.radius, SILVER, subdivisions=5)
VIEW = View(64, 64, yaw_deg=-20.5, pitch_deg=-4.5, fov_y_deg=28.0)
SETTINGS = Settings.model_validate(
    {
        "gbuffer": "cl",
        "atrous": {"levels": 0},
        "trace": {"jitter": False},
        "iprt": {"relight_reflections": False},
        "irradiance": {"rows": 16, "rays": 1},
    }
)


def screen_color(points: Float, normals: Float) -> Float:
    """The screen is black. All else has the walls' color."""
    on_screen = (np.abs(points - SCREEN.centre) < np.array(SCREEN.half) + 1e-3).all(-1)
    return np.where(on_screen[..., None], 0.0, bright_walls(points, normals))


@pytest.fixture(scope="module")
def empty() -> Frame:
    return room_frame(World(), 512, 256, bright_walls)


@pytest.fixture(scope="module")
def screened() -> Frame:
    return room_frame(World(solids=(SCREEN,)), 512, 256, screen_color)


def last_of(
    device: ComputeDevice, video: list[Frame], *, static_camera: bool, steps: int = 1
) -> RenderedFrame:
    with Renderer(
        device,
        video[0],
        [MIRROR],
        VIEW,
        SETTINGS,
        footage=Footage.of(video[0], static_camera=static_camera),
    ) as renderer:
        renderer.step()
        for frame in video[1:]:
            renderer.load(frame)
            picture = renderer.render(steps, ("coverage",))
        return picture


@pytest.mark.thorough
def test_a_mirror_shows_what_a_screen_hides(
    device: ComputeDevice, empty: Frame, screened: Frame
) -> None:
    """Mirrored rays that pass behind the screen find the wall there, and its true color."""
    with_, without = (last_of(device, [empty, screened], static_camera=on) for on in (True, False))
    d = VIEW.directions()
    t, _, normal, _ = BALL.interval(np.zeros_like(d), d)
    point = np.where(np.isfinite(t), t, 0.0)[..., None] * d
    away = d - 2.0 * (d * normal).sum(-1, keepdims=True) * normal
    far, facing, which = World(solids=(SCREEN,)).first_hit(point, away)
    end = point + far[..., None] * away
    wanted = screen_color(end, facing) * SILVER.albedo
    r = np.linalg.norm(end, axis=-1)
    enter, *_ = SCREEN.interval(np.zeros(3), end / r[..., None])
    met = np.isfinite(t) & (with_.aovs["coverage"] == 1.0) & (-(normal * d).sum(-1) > 0.3)
    hidden = met & (which == 0) & (enter > 0.0) & (enter < 0.9 * r)
    assert hidden.sum() > 40
    errors = [np.abs(p.color - wanted).max(-1)[hidden] for p in (with_, without)]
    assert np.median(errors[0]) < 0.02
    assert np.quantile(errors[0], 0.9) < 0.1
    assert np.median(errors[1]) > 0.2
    # What the screen does not hide is shown as before.
    open_ = met & (which == 0) & ~np.isfinite(enter)
    others = [np.abs(p.color - wanted).max(-1)[open_] for p in (with_, without)]
    assert np.mean(others[0]) < np.mean(others[1]) + 1e-3
