"""Surfaces that the frame hides and earlier frames have shown, in the whole frame."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.frame.test_background import BALL, MIRROR, SCREEN, SETTINGS, SILVER, VIEW, screen_color
from tests.oracles.worlds import Sphere, World
from tests.worlds import Float, ball, bright_walls, filmed, pose_at

pytestmark = [pytest.mark.gl, pytest.mark.thorough]

ROOM = World(solids=(SCREEN,))
WAY = tuple((1.3 * share, 0.1 * share, -1.2 * share) for share in np.linspace(1.0, 0.0, 10))
"""A camera that is carried from beside the screen, where it sees the wall behind it."""


@cache
def frame_at(position: tuple[float, float, float]) -> Frame:
    return filmed(ROOM, 256, 128, screen_color, pose_at(position))


def settings(*, learned: bool) -> Settings:
    trace = SETTINGS.trace.model_copy(update={"learned": learned})
    return SETTINGS.model_copy(update={"trace": trace})


def walked(
    device: ComputeDevice, thing: Instance, view: View, name: str, chosen: Settings
) -> tuple[Float, Float]:
    """Mean of a layer in the last frame of the way, without histories, and the coverage."""
    video = [frame_at(position) for position in WAY]
    footage = Footage.of(video[0], static_camera=False)
    with Renderer(device, video[0], [thing], view, chosen, footage=footage) as renderer:
        for frame in video:
            renderer.load(frame)
            renderer.render(1)
        assert renderer.real_world.cut_version <= 1
        renderer.fading = 1.0
        pictures = [renderer.render(1, (name, "coverage")).aovs for _ in range(8)]
    return np.mean([p[name] for p in pictures], axis=0), pictures[0]["coverage"]


def seen_on(thing: Sphere, view: View) -> tuple[Float, Float, NDArray[np.bool_]]:
    """Points (H, W, 3) of a sphere in a view, their normals, and where it is seen, not grazing."""
    d = view.directions()
    t, _, normal, _ = thing.interval(np.zeros_like(d), d)
    seen = np.isfinite(t) & (-(normal * d).sum(-1) > 0.3)
    return np.where(seen, t, 0.0)[..., None] * d, normal, seen


def hides(points: Float) -> NDArray[np.bool_]:
    """Does the screen hide the points (..., 3) from the last frame?"""
    r = np.linalg.norm(points, axis=-1)
    enter, *_ = SCREEN.interval(np.zeros(3), points / r[..., None])
    return np.asarray((enter > 0.0) & (enter < 0.9 * r))


def test_a_mirror_shows_what_was_seen_before(device: ComputeDevice) -> None:
    """Mirrored rays that pass behind the screen find the wall there, and its true colour."""
    shown = [walked(device, MIRROR, VIEW, "specular", settings(learned=on)) for on in (True, False)]
    point, normal, seen = seen_on(BALL, VIEW)
    d = VIEW.directions()
    away = d - 2.0 * (d * normal).sum(-1, keepdims=True) * normal
    far, facing, which = ROOM.first_hit(point, away)
    end = point + far[..., None] * away
    wanted = screen_color(end, facing) * SILVER.albedo
    errors = [np.abs(image - wanted).max(-1) for image, _ in shown]
    wall = seen & (shown[0][1] == 1.0) & (which == 0)
    hidden = wall & hides(end)
    assert hidden.sum() > 40
    assert np.median(errors[0][hidden]) < 0.05
    assert np.median(errors[1][hidden]) > 0.2
    assert errors[0][wall & ~hidden].mean() < errors[1][wall & ~hidden].mean() + 2e-3


def test_a_still_without_anything_hidden_changes_no_bit(device: ComputeDevice) -> None:
    frame = filmed(World(), 128, 64, bright_walls, pose_at())
    things = [MIRROR, ball((0.3, -0.2, -1.3), 0.2, Material(albedo=(0.6, 0.5, 0.4)))]
    pictures = []
    for on in (True, False):
        with Renderer(device, frame, things, VIEW, settings(learned=on)) as renderer:
            pictures.append(renderer.render(3).color)
    np.testing.assert_array_equal(*pictures)
