"""Means of the tracing kernels' estimates are closed forms, pixel by pixel and all together.

Every case draws a million samples or more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.trace.closed_forms import (
    BALL,
    BLACK,
    BOX_VIEW,
    DISC,
    LAMP,
    MATERIALS,
    RUNS,
    as_large,
    ball_factor,
    box_of,
    box_truth,
    confirm_ball,
    disc_factor,
)
from tests.trace.estimators import (
    ESTIMATORS,
    PLAIN,
    Around,
    Estimator,
    confirm,
    furnace,
    kernels,
    lamps,
)
from tests.worlds import ball, cuboid, disc

pytestmark = pytest.mark.thorough

RAYS = 32
WAYS: tuple[Estimator, ...] = ("delta, aimed", "delta, even")


# Real surfaces -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("estimator", "around"),
    [*((estimator, "plain") for estimator in ESTIMATORS), ("delta, aimed", "sphere")],
)
def test_a_ball_hides_light_and_shines(
    device: ComputeDevice, estimator: Estimator, around: Around
) -> None:
    """A spherical light above a plane: irradiance π L (r / d)² cos β, less what it hides."""
    frame = furnace(around)
    objects = [ball(*BALL, LAMP)]
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame)) as run:
        if estimator != "ratio":
            confirm_ball(run, objects[0], RAYS)
            return
        factor = ball_factor(*run.receivers(), BALL[0], as_large(objects[0], BALL[1]))
        change = np.array([run.change(seed, RAYS) for seed in range(RUNS)])
    for channel in (0, 1):
        wanted = (LAMP.albedo[channel] - 1.0) * factor
        confirm(change[..., channel].reshape(RUNS, -1), wanted.ravel())
    # The same rays for both: what shines as bright hides nothing.
    np.testing.assert_allclose(change[..., 2], 0.0, atol=1e-5)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_disc_hides_its_form_factor(device: ComputeDevice, estimator: Estimator) -> None:
    frame = furnace("plain")
    with kernels(device, frame, [disc(*DISC, BLACK)], estimator, aim_at=lamps(frame)) as run:
        wanted = disc_factor(run.receivers()[0], *DISC)
        change = np.array([run.change(seed, RAYS)[..., 0] for seed in range(RUNS)])
    confirm(change.reshape(RUNS, -1), -wanted.ravel())


def test_no_light_leaks_into_a_box_that_stands_on_the_plain(device: ComputeDevice) -> None:
    """Its lower face lies in the plain. Of paths inside only the last ray, which meets no objects
    any more (Algorithm 1, lines 4-6), finds light.
    """
    albedo, bounces = 0.5, 4
    half = np.array([0.4, 0.2, 0.3])
    to_world = np.eye(4)
    to_world[:3, :3] = View(1, 1, yaw_deg=25.0).world_from_view
    to_world[:3, 3] = (0.3, PLAIN + half[1], -1.1)
    box = replace(cuboid((0, 0, 0), half, Material(albedo=(albedo,) * 3)), to_world=to_world)
    frame = furnace("plain")
    with kernels(device, frame, [box], "delta, even") as run:
        local = (run.receivers()[0] - to_world[:3, 3]) @ to_world[:3, :3]
        inside = (np.abs(local) < half - 0.02).all(-1, where=[True, False, True])
        parts = run.parts(1, RAYS)[inside]
    assert inside.sum() > 30
    np.testing.assert_allclose(parts[:, 0], 1.0, rtol=1e-4)
    np.testing.assert_allclose(parts[:, 1], albedo**bounces, rtol=1e-4)


# Virtual surfaces ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "estimator"), [*((name, WAYS[0]) for name in MATERIALS), ("diffuse", WAYS[1])]
)
def test_virtual_surfaces_reflect_their_albedo(
    device: ComputeDevice, name: str, estimator: Estimator
) -> None:
    """Each lobe in a furnace, whatever lights are aimed at."""
    material = MATERIALS[name]
    frame, objects = furnace("sphere"), [box_of(material)]
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame), view=BOX_VIEW) as run:
        runs = [run.reflected(seed, RAYS) for seed in range(RUNS)]
        inside, wanted = box_truth(run, material)
    assert inside.sum() * RUNS * RAYS > 1e6
    for kind in runs[0]:
        found = np.array([one[kind][inside, 0] for one in runs])
        confirm(found, wanted[kind], rounding=5e-4)
