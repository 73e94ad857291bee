"""Auxiliary pictures against the quantities that they claim to measure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import LUMINANCE
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.frame.whole_frame import CLAY, ROOM, SILVER
from tests.oracles.worlds import Sphere, World
from tests.worlds import ball, bright_walls, ceiling_lamp, cuboid, room_frame

pytestmark = pytest.mark.gl

VIEW = View(48, 36, pitch_deg=-35.0)
BALL = Sphere((0.2, -1.0, -1.4), 0.3)
SEEDS = 12
COUNTED: dict[str, Any] = {
    "fading": 0.0,
    "mask": {"sparse": False},
    "trace": {"object_rays": 1},
    "iprt": {"ratio_rows": 16},
    "irradiance": {"rows": 32},
}
"""Every pixel gets one ray a frame, so that samples are frames."""


def settings(**others: Any) -> Settings:
    return Settings.model_validate({**COUNTED, **others})


WIDE = VIEW.resized(96, 72)


def test_hit_distance_of_a_mirror_ball_is_that_of_a_box_room(device: ComputeDevice) -> None:
    plain = {**COUNTED["trace"], "jitter": False}
    world, chosen = World(), settings(trace=plain, iprt={"relight_reflections": False})
    frame = room_frame(world, 256, 128, bright_walls)
    mirror = ball(BALL.centre, BALL.radius, SILVER)
    with Renderer(device, frame, [mirror], WIDE, chosen) as renderer:
        picture = renderer.render(1, ["hit_distance", "coverage"])
        aside = mirror.to_world.copy()
        aside[0, 3] -= 0.7
        renderer.move([replace(mirror, to_world=aside)])
        later = renderer.render(1, ["hit_distance", "coverage"]).aovs
    found, coverage = picture.aovs["hit_distance"], picture.aovs["coverage"]
    d = WIDE.directions()
    t, _, normal, _ = BALL.interval(np.zeros(3), d)
    inside = (coverage > 0.99) & np.isfinite(t) & (-(normal * d).sum(-1) > 0.3)
    p, n = t[inside, None] * d[inside], normal[inside]
    reflected = d[inside] - 2.0 * (d[inside] * n).sum(-1, keepdims=True) * n
    true = world.first_hit(p, reflected)[0]
    assert inside.sum() > 100
    assert np.median(np.abs(found[inside] / true - 1.0)) < 0.01
    assert np.quantile(np.abs(found[inside] / true - 1.0), 0.95) < 0.05
    for values in (picture.aovs, later):
        assert (values["hit_distance"][values["coverage"] == 0.0] == 0.0).all()
        assert (values["hit_distance"][values["coverage"] == 1.0] > 0.1).all()


def test_history_length_of_objects_is_theirs(device: ComputeDevice) -> None:
    """One jumps aside after three frames: it takes its history along, and what it hid has none."""
    frame = room_frame(ROOM, 256, 128, bright_walls)
    hidden = cuboid((0.0, -0.95, -2.0), (0.7, 0.45, 0.1), CLAY)
    thing = cuboid((-0.2, -0.8, -1.4), (0.2, 0.15, 0.1), Material(albedo=(0.2, 0.6, 0.3)))
    to_world = thing.to_world.copy()
    to_world[0, 3] += 0.6
    with Renderer(device, frame, [hidden, thing], VIEW, settings()) as renderer:
        green = renderer.render(3, ["albedo"]).aovs["albedo"]
        renderer.move([hidden, replace(thing, to_world=to_world)])
        picture = renderer.render(1, ["albedo", "coverage", "history_length"])
    before, after = (
        image[..., 1] > 2.0 * image[..., 0] for image in (green, picture.aovs["albedo"])
    )
    length, covered = picture.aovs["history_length"], picture.aovs["coverage"] == 1.0
    uncovered = before & covered & ~after
    assert uncovered.sum() > 20
    np.testing.assert_allclose(length[uncovered], 1.0)
    assert np.median(length[after & covered]) == pytest.approx(4.0, rel=0.1)


def variances(device: ComputeDevice, frames: int) -> dict[str, tuple[Any, Any, NDArray[np.bool_]]]:
    """Return by kind of pixel the mean auxiliary picture, the empirical variance, and a mask."""
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    objects = [ball(BALL.centre, BALL.radius, Material(albedo=(0.6, 0.6, 0.6)), subdivisions=3)]
    told, shown, relit = [], [], []
    for seed in range(SEEDS):
        chosen = settings(seed=seed, atrous={"levels": 0})
        with Renderer(device, frame, objects, VIEW, chosen) as renderer:
            picture = renderer.render(frames, ["variance", "diffuse", "coverage"])
            change = renderer.method.real_pixels.change
            assert change is not None
            planes = renderer.layout.interior(device.read(change))
        told.append(picture.aovs["variance"])
        shown.append(picture.aovs["diffuse"] @ LUMINANCE)
        relit.append(np.tensordot(LUMINANCE, planes[:3] - planes[3:6], 1))
    coverage = picture.aovs["coverage"]
    mean = np.mean(told, axis=0)
    return {
        "object": (mean, np.var(shown, axis=0, ddof=1), coverage == 1.0),
        "real": (mean, np.var(relit, axis=0, ddof=1), coverage == 0.0),
    }


@pytest.mark.thorough
def test_variance_is_that_over_seeds(device: ComputeDevice) -> None:
    """The estimate errs high: few samples may have missed a rare event (temporal.cl), and
    the sequences by which rays are sent err less than random ones.
    """
    for name, (told, empirical, where) in variances(device, frames=16).items():
        noisy = where & (empirical > np.quantile(empirical[where], 0.3)) & (told > 0.0)
        assert noisy.sum() > 50, name
        ratio = told[noisy].mean() / empirical[noisy].mean()
        assert 0.8 < ratio < 3.0, name
        assert np.corrcoef(np.log(told[noisy]), np.log(empirical[noisy]))[0, 1] > 0.8, name
