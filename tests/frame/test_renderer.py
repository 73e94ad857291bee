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
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.frame.whole_frame import still_life
from tests.oracles.worlds import Box, Sphere, World
from tests.rendering import render
from tests.variants import variant
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
    turned,
)

pytestmark = pytest.mark.gl

PILLAR = Box((-0.8, -0.9, -1.7), (0.25, 0.5, 0.2))
ROOM = World(solids=(PILLAR,))
BALL = Sphere((0.2, -1.0, -1.4), 0.3)
CLAY = Material(albedo=(0.6, 0.3, 0.2))
DOWN = View(96, 72, pitch_deg=-35.0)
SMALL = DOWN.resized(48, 36)
PANORAMA = View(256, 128, projection="equirect")
HALF = View(128, 64, projection="equirect")
AOVS = ("ratio", "coverage", "background", "normal", "irradiance_real")
MEAN: dict[str, Any] = {"fading": 0.0}
RAW: dict[str, Any] = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}


def lit_room(radiance: Radiance = ceiling_lamp) -> tuple[Frame, list[Instance]]:
    """A ball beside a pillar: below a lamp, or among bright walls, which is less noisy."""
    return room_frame(ROOM, 256, 128, radiance), [ball(BALL.centre, BALL.radius, CLAY)]


def settings(**chosen: Any) -> Settings:
    return Settings.model_validate(chosen)


def rms(difference: NDArray[np.floating]) -> float:
    return float(np.sqrt((difference.astype(np.float64) ** 2).mean()))


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
    assert (~untouched & real(picture)).mean() > 0.1
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


@pytest.mark.thorough
def test_the_seam_does_not_show(device: ComputeDevice) -> None:
    """A ball across the seam, one over the nadir: turned to elsewhere, they look the same."""
    frame, _ = lit_room(bright_walls)
    objects = [ball((0.1, -1.1, 0.15), 0.2, CLAY), ball((-0.1, -1.0, 1.6), 0.3, CLAY)]
    sure: dict[str, Any] = {"trace": {"rays": 32}, "irradiance": {"rows": 32}, **MEAN}
    still = render(device, frame, objects, HALF, settings(**sure), 4)
    assert (still.aovs["coverage"][:, [0, -1]] == 1.0).sum() > 5
    rolled, moved, _ = turned(frame, objects, 128)
    picture = render(device, rolled, moved, HALF, settings(**sure), 4)

    def difference(name: str) -> Float:
        return np.asarray(np.roll(picture.aovs[name], -64, 1) - still.aovs[name], np.float64)

    np.testing.assert_allclose(difference("coverage"), 0.0, atol=0.07)
    error = difference("ratio")
    assert still.aovs["ratio"].min() < 0.95
    assert rms(error) < 0.01
    # Noise averages out over 8 x 8 pixels, what is done otherwise at the seam would not.
    blocks = np.roll(error, 4, 1).reshape(8, 8, 16, 8, 3).mean((1, 3))
    assert np.abs(blocks).max() < 0.01
    alike = np.isclose(np.roll(picture.color, -64, 1), still.color, rtol=0.3, atol=0.01)
    assert alike.mean() > 0.999


# Randomness ----------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("view", [SMALL, HALF], ids=lambda v: v.projection)
def test_the_seed_makes_the_picture(device: ComputeDevice, view: View) -> None:
    frame, objects = lit_room(bright_walls)[0], still_life()
    first, again, other = (
        render(device, frame, objects, view, settings(seed=seed), 4) for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(first.color, again.color)
    for name in AOVS:
        np.testing.assert_array_equal(first.aovs[name], again.aovs[name])
    for pixels in (real(first), first.aovs["coverage"] == 1.0):
        assert (first.color != other.color)[pixels].mean() > 0.2
    np.testing.assert_allclose(first.color.mean((0, 1)), other.color.mean((0, 1)), rtol=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize(("estimator", "filtered_to"), [("delta", 1.0), ("ratio", 0.8)])
def test_frames_average_out_the_noise(
    device: ComputeDevice, estimator: str, filtered_to: float
) -> None:
    """Four times the frames, about half the error, where E_R is known."""
    frame, objects = lit_room()

    def accumulated(frames: int, **others: Any) -> RenderedFrame:
        chosen = variant(estimator, **others)
        with Renderer(device, frame, objects, SMALL, chosen) as renderer:
            return renderer.render(frames, AOVS)

    coarse = {"iprt": {"ratio_rows": 16}}
    many = {"rays": 32, "object_rays": 32}
    sure: dict[str, Any] = {"rows": 16, "rays": 512, "samples": 1024}
    truth = accumulated(16, seed=1, trace=many, irradiance=sure, **coarse, **RAW)
    # One ray of objects in every frame: by default there are more in the first ones.
    few: dict[str, Any] = {"trace": {"object_rays": 1}, "irradiance": sure, **coarse}
    pictures = {}
    chosen = variant(estimator, **few, **RAW)
    with Renderer(device, frame, objects, SMALL, chosen) as renderer:
        for more, frames in ((1, 1), (3, 4), (12, 16), (48, 64)):
            pictures[frames] = renderer.render(more, AOVS)

    later = [pictures[frames] for frames in (4, 16, 64)]
    for errors in (
        [rms(picture.aovs["ratio"] - truth.aovs["ratio"]) for picture in later],
        [rms(picture.color - truth.color) for picture in later],
    ):
        assert errors[1] < 0.75 * errors[0]
        assert errors[2] < 0.75 * errors[1]
    for picture in later:
        assert picture.color.mean() == pytest.approx(truth.color.mean(), rel=0.02)
    # The filter pays where there is noise: after a frame, and less where there is less of it.
    raw = pictures[1].aovs["ratio"]
    plain = {**MEAN, "mask": {"sparse": False}}
    filtered = accumulated(1, **few, **plain).aovs["ratio"]
    assert rms(filtered - truth.aovs["ratio"]) < filtered_to * rms(raw - truth.aovs["ratio"])


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


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("view", "sigma"), [(View(96, 72, -25.0, fov_y_deg=15.0), 10.0), (HALF, 0.5)]
)
def test_rays_are_spared(device: ComputeDevice, view: View, sigma: float) -> None:
    """Where surfaces are flat and nothing shadows them; all pixels get one when told so."""
    frame, _ = lit_room()
    opening = np.zeros(frame.depth.shape, bool)
    opening[30:40, 40:60] = True
    objects = [ball((0.4, -1.3, -2.2), 0.05, CLAY)]
    traced = {}
    for sparse in (True, False):
        settings = {
            "mask": {"sparse": sparse, "sigma_position": sigma},
            "trace": {"openings": "surface"},
        }
        with Renderer(
            device, replace(frame, opening=opening), objects, view,
            Settings.model_validate(settings),
        ) as renderer:  # fmt: skip
            renderer.render(12)
            traced[sparse] = int(device.read(renderer.method.real_pixels.mask.count)[0])
            surfaces = int(renderer.layout.interior(device.read(renderer.real.id)).sum())
    assert traced[False] == surfaces
    assert 0 < traced[True] < 0.5 * surfaces
