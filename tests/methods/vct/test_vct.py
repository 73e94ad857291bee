"""Voxel cone tracing against closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.rendering import render
from tests.trace.closed_forms import (
    BALL,
    BLACK,
    BOX_VIEW,
    DISC,
    LAMP,
    as_large,
    ball_factor,
    box_of,
    box_truth,
    disc_factor,
)
from tests.trace.environments import CLAY, windowed
from tests.trace.estimators import PLAIN, furnace, kernels
from tests.worlds import Float, ball, disc, scaled, sphere_frame

COARSE: dict[str, Any] = {"voxels": 32, "object_voxels": 32, "cones": 128}


def vct(**own: Any) -> Settings:
    raw: dict[str, Any] = {"atrous": {"levels": 0}, "mask": {"sparse": False}}
    return Settings.model_validate({"method": "vct", **raw, "vct": {**COARSE, **own}})


# Cones ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["ball", "disc"])
def test_errors_of_shadows_shrink_with_voxels(device: ComputeDevice, shape: str) -> None:
    """And with cones: form factors of a ball and of a disc above a plain, under an even sky."""
    made = ball(*BALL, BLACK) if shape == "ball" else disc(*DISC, BLACK)
    errors = []
    for resolution, cones in ((16, 16), (64, 128)):
        own = {**COARSE, "object_voxels": resolution, "cones": cones}
        with kernels(device, furnace("plain"), [made], "vct, even", own=own) as run:
            points, normals = run.receivers()
            wanted = (
                ball_factor(points, normals, BALL[0], as_large(made, BALL[1]))
                if shape == "ball"
                else disc_factor(points, *DISC)
            )
            parts = np.mean([run.parts(seed, 64) for seed in range(4)], axis=0)
            voxel = run.renderer.method.voxels.objects.grid.voxel
        np.testing.assert_array_equal(parts[..., 1, :], 0.0)
        errors.append(parts[..., 0, 0].mean() / wanted.mean() - 1.0)
        # A border as wide as the voxels that a cone meets at the middle of the object.
        away = BALL[0][1] - PLAIN
        border = max(voxel, 0.5 * away * np.sqrt(1.0 / cones))
        assert abs(errors[-1]) < 2.0 * border / BALL[1]
    assert abs(errors[1]) < 0.13
    assert abs(errors[1]) < abs(errors[0])


def test_what_shines_as_bright_as_what_it_hides(device: ComputeDevice) -> None:
    """A white ball in a furnace sends almost as much as it hides; a grey one half of it."""
    with kernels(device, furnace("sphere"), [ball(*BALL, LAMP)], "vct, even", own=COARSE) as run:
        hidden, sent = np.moveaxis(np.mean([run.parts(i, 64) for i in range(4)], axis=0), -2, 0)
    np.testing.assert_array_equal(sent[..., 0], 0.0)
    np.testing.assert_allclose(sent[..., 1].mean(), 0.5 * sent[..., 2].mean(), rtol=1e-3)
    # The plain's reach of the ball is a sphere's wall: nothing is darker.
    assert 0.9 < sent[..., 2].mean() / hidden[..., 2].mean() <= 1.001


@pytest.mark.parametrize("name", ["diffuse", "conductor", "plastic"])
def test_objects_reflect_their_albedo_in_a_furnace(device: ComputeDevice, name: Any) -> None:
    material = Material(name, (0.9, 0.6, 0.3), alpha=0.3)
    frame, own = furnace("sphere"), {**COARSE, "object_voxels": 64}
    with kernels(device, frame, [box_of(material)], "vct, even", view=BOX_VIEW, own=own) as run:
        runs = [run.reflected(seed, 64) for seed in range(4)]
        inside, wanted = box_truth(run, material)
    for kind in runs[0]:
        found = np.mean([one[kind][inside, 0] for one in runs], axis=0)
        np.testing.assert_allclose(found.mean(), wanted[kind].mean(), rtol=0.03)


# Pictures ------------------------------------------------------------------------------------

LOOK = View(48, 36, pitch_deg=-35.0)


def test_light_varies_with_the_place_in_the_room(device: ComputeDevice) -> None:
    """Objects and all, ten times as large, are the same; far walls alone are others."""
    rng = np.random.default_rng(3)
    color = rng.random((32, 64, 3)).repeat(4, 0).repeat(4, 1).astype(np.float32)
    near = replace(sphere_frame(1.9, 256, 128, 1.0), color=color)
    objects = [ball((0.4, -0.5, -1.3), 0.4, CLAY)]

    def shown(frame: Any, placed: list[Instance]) -> Float:
        picture = render(device, frame, placed, LOOK, vct(), 8)
        return np.asarray(picture.color[picture.aovs["coverage"] == 1.0])

    larger = scaled(near, objects, 8.0)
    np.testing.assert_allclose(shown(*larger), shown(near, objects), rtol=1e-3, atol=1e-4)
    far, _ = scaled(near, [], 8.0)
    assert np.abs(shown(far, objects) - shown(near, objects)).mean() > 0.005


def test_moved_objects_take_their_voxels_along(device: ComputeDevice) -> None:
    """After a move the voxels equal those of a renderer that started there."""
    before, after = [ball((-0.3, -1.0, -0.9), 0.3, CLAY)], [ball(*BALL, CLAY)]
    after = [replace(before[0], to_world=after[0].to_world)]
    with Renderer(device, windowed(), before, LOOK, vct()) as renderer:
        renderer.step()
        renderer.move(after)
        renderer.step()
        moved = device.read(renderer.method.voxels.objects.light)
        size = renderer.method.voxels.objects.finest
    with Renderer(device, windowed(), after, LOOK, vct()) as renderer:
        renderer.step()
        placed = device.read(renderer.method.voxels.objects.light)
    np.testing.assert_array_equal(moved[:size], placed[:size])
