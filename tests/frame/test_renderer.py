"""The whole frame: what must not change stays, what must agree agrees."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import solid_angles
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.frame.whole_frame import CLAY, ROOM, rms
from tests.oracles.worlds import Box, Sphere, World
from tests.rendering import render
from tests.worlds import (
    Float,
    Radiance,
    ball,
    bright_walls,
    ceiling_lamp,
    landscape_frame,
    panorama_at,
    panorama_in,
    room_frame,
)

pytestmark = pytest.mark.gl

BALL = Sphere((0.2, -1.0, -1.4), 0.3)
DOWN = View(96, 72, pitch_deg=-35.0)
PANORAMA = View(256, 128, projection="equirect")
AOVS = ("ratio", "coverage", "background", "normal", "irradiance_real")
MEAN: dict[str, Any] = {"fading": 0.0}


def lit_room(radiance: Radiance = ceiling_lamp) -> tuple[Frame, list[Instance]]:
    """A ball beside a pillar: below a lamp, or among bright walls, which is less noisy."""
    return room_frame(ROOM, 256, 128, radiance), [ball(BALL.centre, BALL.radius, CLAY)]


def settings(**chosen: Any) -> Settings:
    return Settings.model_validate(chosen)


def real(picture: RenderedFrame) -> NDArray[np.bool_]:
    """Pixels without an object."""
    return np.asarray(picture.aovs["coverage"] == 0.0)


# Bits that must not change -------------------------------------------------------------------

HIDDEN = World(solids=(Box((-0.2, -0.2, -1.3), (1.5, 1.0, 0.1)),))
BEHIND = Sphere((1.9, -1.1, -1.5), 0.15)
ASIDE = View(96, 72, yaw_deg=25.0, pitch_deg=-4.0)
"""Shows a slab's front, and beside it a ball that stands behind the plane of that front."""


@pytest.mark.parametrize("view", [DOWN, PANORAMA], ids=lambda view: view.projection)
def test_without_objects_the_input_is_the_output(device: ComputeDevice, view: View) -> None:
    color = np.random.default_rng(4).uniform(0.0, 9.0, (128, 256, 3)).astype(np.float32)
    frame = replace(ROOM.frame(256, 128), color=color)
    picture = render(device, frame, [], view, settings(), 2)
    np.testing.assert_array_equal(picture.color, picture.aovs["background"])
    np.testing.assert_allclose(picture.color, panorama_in(color, view), atol=5e-3)
    if view is PANORAMA:
        np.testing.assert_array_equal(picture.color, color)
    own = np.random.default_rng(5).random((view.height, view.width, 3)).astype(np.float32)
    over = render(device, frame, [], view, settings(), background=own)
    np.testing.assert_array_equal(over.color, own)


@pytest.mark.parametrize("view", [ASIDE, PANORAMA], ids=lambda view: view.projection)
@pytest.mark.parametrize("own", [False, True], ids=["panorama", "background"])
def test_what_objects_do_not_touch_keeps_its_bits(
    device: ComputeDevice, view: View, own: bool
) -> None:
    """Certainly all of a surface that has the objects behind its plane, however long it takes.

    But for pixels at its edge, which show a little of what is beside it.
    """
    frame = room_frame(HIDDEN, 256, 128, ceiling_lamp)
    objects = [ball(BEHIND.centre, BEHIND.radius, CLAY)]
    background = None
    if own:
        background = np.random.default_rng(1).random((view.height, view.width, 3), np.float32)
    before = render(device, frame, [], view, settings(), background=background).color
    picture = render(device, frame, objects, view, settings(), 6, background=background)
    ratio, untouched = picture.aovs["ratio"], real(picture)
    untouched &= (ratio == 1.0).all(-1)
    np.testing.assert_array_equal(picture.color[untouched], before[untouched])
    d = view.directions()
    point = d * HIDDEN.first_hit(np.zeros(3), d)[0][..., None]
    normal = picture.aovs["normal"]
    ahead = ((np.array(BEHIND.centre) - point) * normal).sum(-1) + BEHIND.radius
    unseen = minimum_filter(real(picture) & (ahead < -0.02), 3)
    assert untouched[unseen].all()
    assert unseen.mean() > (0.5 if view is ASIDE else 0.1)
    # Elsewhere there is influence, so the test could fail.
    assert (~untouched & real(picture)).mean() > 0.05
    assert ratio[real(picture)].min() < 0.99


def test_the_sky_keeps_its_bits(device: ComputeDevice) -> None:
    frame, view = landscape_frame(256, 128), View(96, 72)
    objects = [ball((0.1, 0.0, -2.0), 0.5, CLAY)]
    picture = render(device, frame, objects, view, settings(), 4)
    sky = real(picture) & (view.directions()[..., 1] > 0.02)
    assert sky.sum() > 2000
    np.testing.assert_array_equal(picture.color[sky], picture.aovs["background"][sky])
    assert picture.aovs["ratio"].min() < 0.95


# Two projections, and every heading ----------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    "view", [DOWN, View(96, 72, yaw_deg=178.0, pitch_deg=-30.0)], ids=["ahead", "seam"]
)
def test_both_projections_agree(device: ComputeDevice, view: View) -> None:
    frame, objects = lit_room(bright_walls)
    objects.append(ball((-0.2, -1.0, 1.5), 0.3, CLAY))
    # Only what the view shows is relit in reflections, which is another part in each projection.
    trace = {"rays": 8}
    whole = render(device, frame, objects, PANORAMA, settings(trace=trace, **MEAN), 4)
    part = render(device, frame, objects, view, settings(trace=trace, **MEAN), 8)
    d = view.directions()
    covered = panorama_at(whole.aovs["coverage"][..., None], d)[..., 0]
    ground = (covered == 0.0) & real(part)
    error = (panorama_at(whole.aovs["ratio"], d) - part.aovs["ratio"])[ground]
    assert part.aovs["ratio"][ground].min() < 0.95
    assert rms(error) < 0.015
    assert np.abs(error.mean()) < 2e-3
    assert np.median(np.abs(error)) < 5e-3
    solid = (covered == 1.0) & (part.aovs["coverage"] == 1.0)
    assert solid.sum() > 200
    shown, other = panorama_at(whole.color, d)[solid], part.color[solid]
    np.testing.assert_allclose(shown.mean(0), other.mean(0), rtol=0.03)
    assert rms(shown / other - 1.0) < 0.1


# A head that turns ---------------------------------------------------------------------------


@pytest.mark.thorough
def test_turning_leaves_no_trails(device: ComputeDevice) -> None:
    """After a turn the picture is as good as one that was always there, in no place worse."""
    frame, objects = lit_room()
    coarse: dict[str, Any] = {"iprt": {"ratio_rows": 16}, "irradiance": {"rows": 32}}
    sure = {"trace": {"rays": 16}, **coarse}
    truth = render(device, frame, objects, DOWN, settings(seed=1, **sure, **MEAN), 8)
    fresh = render(device, frame, objects, DOWN, settings(**coarse), 24)
    ground, solid = real(truth), truth.aovs["coverage"] == 1.0
    lit = truth.aovs["ratio"].min(-1)[ground] > 0.995
    assert lit.mean() > 0.3

    def error(picture: RenderedFrame) -> Float:
        assert np.isfinite(picture.color).all()
        return np.asarray(np.abs(picture.aovs["ratio"] - truth.aovs["ratio"])[ground], np.float64)

    for deg in (0.3, -2.5):
        picture, rested = turned_to(device, frame, objects, deg, Settings.model_validate(coarse))
        assert rms(error(picture)) < 1.4 * rms(error(fresh))
        assert rms(error(rested)) < 1.25 * rms(error(fresh))
        assert np.percentile(error(picture), 99.0) < 0.15
        # Where no shadow is, none is left behind.
        assert np.percentile(error(picture)[lit], 99.9) < 0.1
        shown = picture.color[solid].mean(0) / truth.color[solid].mean(0)
        np.testing.assert_allclose(shown, 1.0, atol=0.15)


def turned_to(
    device: ComputeDevice,
    frame: Frame,
    objects: list[Instance],
    deg: float,
    settings: Settings,
    steps: int = 16,
) -> tuple[RenderedFrame, RenderedFrame]:
    """The view `DOWN` after a turn by so many degrees a frame, and some frames later."""
    start = replace(DOWN, yaw_deg=-deg * steps, pitch_deg=DOWN.pitch_deg + 0.2 * steps)
    with Renderer(device, frame, objects, start, settings) as renderer:
        renderer.render(6)
        for i in range(1, steps + 1):
            pitch_deg = start.pitch_deg - 0.2 * i
            renderer.look(replace(start, yaw_deg=start.yaw_deg + deg * i, pitch_deg=pitch_deg))
            renderer.step()
        return renderer.render(0, AOVS), renderer.render(8, AOVS)


# Settings ------------------------------------------------------------------------------------


def test_distant_environment_is_the_cosine_convolution(device: ComputeDevice) -> None:
    """And it changes no real pixel."""
    frame = room_frame(ROOM, 64, 32, bright_walls)
    view = View(64, 48)
    chosen = settings(method="ibl", trace={"rays": 64}, **MEAN)
    picture = render(device, frame, [ball((0.2, 0.0, -1.2), 0.4, CLAY)], view, chosen, 8)
    d = View(64, 32, projection="equirect").directions().reshape(-1, 3)
    sr = np.broadcast_to(solid_angles(64, 32)[:, None], (32, 64)).reshape(-1)
    solid = picture.aovs["coverage"] == 1.0
    assert solid.sum() > 300
    cosine = np.maximum(picture.aovs["normal"][solid].astype(np.float64) @ d.T, 0.0)
    irradiance = (cosine * sr) @ frame.color.reshape(-1, 3).astype(np.float64)
    wanted = np.array(CLAY.albedo) * irradiance / np.pi
    np.testing.assert_allclose(picture.color[solid], wanted, rtol=0.05)
    np.testing.assert_allclose(picture.color[solid].mean(0), wanted.mean(0), rtol=2e-3)
    ground = real(picture)
    np.testing.assert_array_equal(picture.color[ground], picture.aovs["background"][ground])
