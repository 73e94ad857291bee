"""Shared by tests of whole frames: a scene with one of everything, and measures of pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.filter.temporal import Temporal
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.measure.metrics import ssim
from iprt.output.display import display
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.oracles.worlds import Box, World
from tests.variants import variant
from tests.worlds import Float, ball, bright_walls, ceiling_lamp, cuboid, room_frame

ROOM = World(solids=(Box((-0.8, -0.9, -1.7), (0.25, 0.5, 0.2)),))
CLAY = Material(albedo=(0.6, 0.3, 0.2))
SATIN = Material("plastic", (0.2, 0.5, 0.8), alpha=0.2)
BRASS = Material("conductor", (0.9, 0.7, 0.4), alpha=0.2)
SILVER = Material("conductor", (0.9, 0.9, 0.9), alpha=0.0)
VIEW = View(48, 36, pitch_deg=-35.0)
PANORAMA = View(64, 32, projection="equirect")
METHODS = [("delta", "triangles"), ("ratio", "layers")]
"""Estimators of real surfaces, and representations of objects: every value of both."""
METHOD = pytest.mark.parametrize(
    "method",
    [METHODS[0], pytest.param(METHODS[1], marks=pytest.mark.thorough)],
    ids="-".join,
)


def still_life() -> list[Instance]:
    """One object of every kind of material on the floor ahead, none of them symmetric about it."""
    yaw = np.deg2rad(25.0)
    turn = np.eye(4)
    turn[:3, :3] = [[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]]
    box = cuboid((0.0, 0.0, 0.0), (0.22, 0.2, 0.15), SATIN)
    at = np.eye(4)
    at[:3, 3] = (0.5, -1.2, -1.3)
    return [
        ball((0.0, -1.1, -1.7), 0.3, CLAY),
        replace(box, to_world=at @ turn),
        ball((-0.15, -1.28, -1.15), 0.12, SILVER),
        ball((-0.45, -1.25, -1.3), 0.15, BRASS),
    ]


def two_frames() -> tuple[Frame, Frame]:
    """A room among bright walls, and the same lit by a lamp."""
    return room_frame(ROOM, 256, 128, bright_walls), room_frame(ROOM, 256, 128, ceiling_lamp)


def chosen(method: tuple[str, str], **others: Any) -> Settings:
    """Default settings with one of `METHODS`, and others; grids as coarse as the pictures."""
    estimator, objects = method
    own = {"ratio_rows": 16} | others.pop("iprt", {})
    return variant(estimator, objects=objects, iprt=own, **{"irradiance": {"rows": 32}, **others})


def film(
    device: ComputeDevice,
    frames: Sequence[Frame],
    objects: Sequence[Instance],
    view: View,
    settings: Settings,
) -> list[RenderedFrame]:
    """Return pictures at rest, after the head has turned, and after the video has changed."""
    with Renderer(device, frames[0], objects, view, settings) as renderer:
        pictures = [renderer.render(2, AOVS)]
        if view.projection == "perspective":
            renderer.look(replace(view, yaw_deg=view.yaw_deg + 2.0))
        pictures.append(renderer.render(2, AOVS))
        renderer.load(frames[1])
        pictures.append(renderer.render(3, AOVS))
        require_finite(renderer, pictures)
    return pictures


def require_finite(renderer: Renderer, pictures: Sequence[RenderedFrame], after: str = "") -> None:
    """Require finite pictures, auxiliary pictures, histories and cache of E_R."""
    for picture in pictures:
        assert np.isfinite(picture.color).all(), after
        assert (picture.color >= 0.0).all(), after
        for name, values in picture.aovs.items():
            assert np.isfinite(values).all(), (after, name)
    for name, values in remembered(renderer):
        assert np.isfinite(values).all(), (after, name)


def remembered(renderer: Renderer) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Everything that later frames build on, by name."""
    device = renderer.device
    for index, temporal in enumerate(temporals(renderer, set())):
        for state in ("_now", "_before", "_fast", "_fast_before"):
            history = getattr(temporal, state, None)
            if history is None:  # the published filter has one only
                continue
            layout = temporal._signals[0].guide.layout
            for part, planes in history.arguments(f"{index} {state} {{}}").items():
                yield part, layout.interior(device.read(planes))
    if renderer.real_world.irradiance is not None:
        yield "irradiance mean", device.read(renderer.real_world.irradiance.mean)
        yield "irradiance", device.read(renderer.real_world.irradiance.irradiance)


def temporals(thing: object, seen: set[int]) -> Iterator[Temporal]:
    """The histories that something holds, however deep."""
    if id(thing) in seen:
        return
    seen.add(id(thing))
    if isinstance(thing, Temporal):
        yield thing
    parts: Sequence[object] = ()
    if isinstance(thing, dict):
        parts = list(thing.values())
    elif type(thing).__module__.startswith("iprt."):
        parts = list(getattr(thing, "__dict__", {}).values())
    for part in parts:
        yield from temporals(part, seen)


def likeness(picture: Float, truth: Float) -> float:
    """SSIM of two pictures as displayed, at an exposure that shows `truth` well."""
    exposure = 0.4 / max(float(truth.mean()), 1e-300)
    return ssim(display(picture, exposure), display(truth, exposure))


def rms(difference: NDArray[np.floating]) -> float:
    return float(np.sqrt((difference.astype(np.float64) ** 2).mean()))


def blocks(image: Float, side: int = 6) -> Float:
    """Means over squares of pixels of (H, W, 3), which have less noise than pixels."""
    height, width = (n // side * side for n in image.shape[:2])
    parts = image[:height, :width].reshape(height // side, side, width // side, side, -1)
    return np.asarray(parts.mean((1, 3), dtype=np.float64))


def require_only_noise(picture: Float, still: Float, again: Float) -> None:
    """`picture` differs from `still` as `again` does, which is `still` with other random numbers.

    Neighbours share their noise, so that the difference of two pictures is unsure by a third.
    """
    noise = rms(again - still)
    assert noise > 0.0
    assert rms(picture - still) < 1.5 * noise
    assert rms(blocks(picture) - blocks(still)) < 2.0 * rms(blocks(again) - blocks(still))
