"""Invariances of the picture: units, the seam's place, mirror images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame
from tests.frame.whole_frame import (
    METHOD,
    METHODS,
    PANORAMA,
    VIEW,
    chosen,
    film,
    likeness,
    require_only_noise,
    rms,
    still_life,
    two_frames,
)
from tests.rendering import render
from tests.worlds import (
    Float,
    mirrored,
    scaled,
    turned,
)

pytestmark = pytest.mark.gl

LAYERS = ("coverage", "depth", "normal", "background")
Scene = tuple[Frame, Sequence[Instance], View]


@dataclass(frozen=True)
class Film:
    """Pictures that `film` made of a scene, and the scene."""

    method: tuple[str, str]
    view: View
    frames: Sequence[Frame]
    objects: Sequence[Instance]
    pictures: Sequence[RenderedFrame]


# Units ----------------------------------------------------------------------------------------

CASES = [
    (METHODS[0], VIEW),
    pytest.param((METHODS[1], VIEW), marks=pytest.mark.thorough),
    (METHODS[0], PANORAMA),
]
SEED = 1
"""With other seeds, rounding moves a ray or two across an edge."""
CASE_NAMES = ["delta-triangles", "ratio-layers", "panorama"]


@pytest.fixture(scope="module", params=CASES, ids=CASE_NAMES)
def plain(request: pytest.FixtureRequest, device: ComputeDevice) -> Film:
    """A film in metres and ordinary light."""
    method, view = request.param
    frames, objects = two_frames(), still_life()
    pictures = film(device, frames, objects, view, chosen(method, seed=SEED))
    return Film(method, view, frames, objects, pictures)


@pytest.mark.parametrize("factor", [1e-3, 1e4])
def test_lengths_may_have_any_unit(device: ComputeDevice, plain: Film, factor: float) -> None:
    """Millimetres or tens of kilometres in place of metres: at rest, in motion, after a cut."""
    scenes = [scaled(frame, plain.objects, factor) for frame in plain.frames]
    objects = scenes[0][1]
    other = film(
        device, [f for f, _ in scenes], objects, plain.view, chosen(plain.method, seed=SEED)
    )
    for was, found in zip(plain.pictures, other, strict=True):
        # Rounding moves a few rays to other texels and triangles, at edges above all.
        assert likeness(found.color, was.color) > 0.9998
        assert rms((found.color - was.color) / was.color.mean()) < 5e-3
        for name in ("ratio", "coverage"):
            assert rms(found.aovs[name] - was.aovs[name]) < 3e-3, name
        np.testing.assert_allclose(
            found.aovs["depth"] / factor, was.aovs["depth"], rtol=1e-5, atol=1e-6
        )


@pytest.mark.parametrize("factor", [1e-4, 1e4])
def test_light_may_have_any_unit(device: ComputeDevice, plain: Film, factor: float) -> None:
    frames = [replace(f, color=f.color * np.float32(factor)) for f in plain.frames]
    other = film(device, frames, plain.objects, plain.view, chosen(plain.method, seed=SEED))
    for was, found in zip(plain.pictures, other, strict=True):
        color = found.color / np.float32(factor)
        assert likeness(color, was.color) > 0.9999
        assert rms((color - was.color) / was.color.mean()) < 5e-4
        assert rms(found.aovs["ratio"] - was.aovs["ratio"]) < 5e-4


@pytest.mark.thorough
def test_planes_in_half_precision_are_not_seen(device: ComputeDevice, gpu: ComputeDevice) -> None:
    """Neither beside planes of float, nor in light of another unit."""
    frames, objects = two_frames(), still_life()
    settings = chosen(METHODS[0], gbuffer="gl", seed=SEED)
    plain = film(device, frames, objects, VIEW, settings)
    for factor in (1.0, 3e-4, 3e4):
        bright = [replace(f, color=f.color * np.float32(factor)) for f in frames]
        for was, found in zip(plain, film(gpu, bright, objects, VIEW, settings), strict=True):
            color = found.color / np.float32(factor)
            assert likeness(color, was.color) > 0.9999
            assert rms((color - was.color) / was.color.mean()) < 5e-4


# Turned and mirrored worlds -------------------------------------------------------------------


def agrees(device: ComputeDevice, method: tuple[str, str], scene: Scene, other: Scene) -> None:
    """Both scenes look alike; of the other one, the mirrored picture where its view is mirrored."""
    mirror = scene[2].yaw_deg == -other[2].yaw_deg != 0.0
    # The tolerance below is relative to the noise of four rays.
    many: dict[str, Any] = {"fading": 0.0, "trace": {"rays": 4, "object_rays": 4}}
    still, again = (
        render(device, *scene, chosen(method, seed=seed, **many), frames=6) for seed in (0, 1)
    )
    picture = render(device, *other, chosen(method, seed=2, **many), frames=6)

    def of_other(name: str) -> Float:
        image = np.asarray(picture.color if name == "color" else picture.aovs[name], np.float64)
        return image[:, ::-1] if mirror else image

    # These are not random, but edges may have another sample of 16.
    for name in LAYERS:
        side = (-1.0, 1.0, 1.0) if mirror else (1.0, 1.0, 1.0)
        found = of_other(name)
        if name == "normal":
            turn = scene[2].world_from_view @ other[2].world_from_view.T
            found = of_other(name) * side if mirror else of_other(name) @ turn.T
        apart = np.abs(found - still.aovs[name])
        assert np.percentile(apart, 98.0) < 0.01 * max(1.0, np.abs(still.aovs[name]).max()), name
    assert still.aovs["ratio"].min() < 0.9
    for name in ("color", "ratio"):
        a, b = (p.color if name == "color" else p.aovs[name] for p in (still, again))
        require_only_noise(of_other(name), np.asarray(a, np.float64), np.asarray(b, np.float64))
    assert likeness(of_other("color"), still.color) > 0.97


@pytest.mark.parametrize(
    ("method", "columns"),
    [
        (METHODS[0], 77),
        (METHODS[0], 126),
        pytest.param(METHODS[1], 1, marks=pytest.mark.thorough),
        pytest.param(METHODS[1], 135, marks=pytest.mark.thorough),
    ],
    ids=str,
)
def test_a_rolled_panorama_looks_the_same(
    device: ComputeDevice, method: tuple[str, str], columns: int
) -> None:
    """Rolled by columns with the objects, and the head turned alike: the seam may lie in view."""
    frame, objects = two_frames()[0], still_life()
    rolled, moved, yaw_deg = turned(frame, objects, columns)
    view = replace(VIEW, yaw_deg=4.0)
    there = replace(view, yaw_deg=view.yaw_deg + yaw_deg)
    agrees(device, method, (frame, objects, view), (rolled, moved, there))


@pytest.mark.thorough
@METHOD
@pytest.mark.parametrize("meshes", [False, True], ids=["transforms", "meshes"])
def test_a_mirrored_world_looks_mirrored(
    device: ComputeDevice, method: tuple[str, str], meshes: bool
) -> None:
    frame, objects = two_frames()[0], still_life()
    flipped, moved = mirrored(frame, objects, meshes=meshes)
    view = replace(VIEW, yaw_deg=7.0)
    agrees(device, method, (frame, objects, view), (flipped, moved, replace(view, yaw_deg=-7.0)))
