"""Rays see `Frame.radiance`, the picture shows `Frame.picture`, also where these differ."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.films import FEW, LOOK
from tests.frame.whole_frame import still_life
from tests.oracles.worlds import World
from tests.worlds import ball, bright_walls, ceiling_lamp, room_frame

AROUND = View(64, 32, projection="equirect")
FLOOR = Material("plastic", alpha=0.2)
SETTINGS = Settings.model_validate(FEW)
BALL = ball((0.0, -1.1, -1.7), 0.3, Material(), subdivisions=1)


def lit(*, window: bool = False, gloss: bool = False) -> Frame:
    """A dim room under a bright lamp, with a window in a wall, on a glossy floor."""
    frame = room_frame(World(), 64, 32, ceiling_lamp)
    rows, columns = np.indices(frame.depth.shape)
    if window:
        inside = (np.abs(rows - 14) < 3) & (np.abs(columns - 40) < 3)
        frame = replace(frame, opening=inside)
        frame.color[inside] = 3.0
    if gloss:
        floor = (frame.normal[..., 1] > 0.5).astype(np.uint8)
        frame = replace(frame, gloss=floor, real_materials=(FLOOR,))
    return frame


def clipped(frame: Frame) -> Frame:
    """The frame as a camera shows it that sees nothing brighter than 1; its light is known."""
    texel = np.flatnonzero((frame.color > 1.0).any(-1)).astype(np.int32)
    seen = np.minimum(frame.color.reshape(-1, 3)[texel], np.float32(1.0))
    return replace(frame, clipped=ClippedTexels(texel, seen))


def all_texels(frame: Frame) -> ClippedTexels:
    """Every texel is shown apart, as it is."""
    return ClippedTexels(np.arange(frame.depth.size, dtype=np.int32), frame.color.reshape(-1, 3))


def pictures(
    device: ComputeDevice,
    frame: Frame,
    view: View,
    background: NDArray[np.float32] | None = None,
    **kwargs: Any,
) -> list[NDArray[np.float32]]:
    objects = still_life() if frame.real_materials else [BALL]  # the kernels of other tests
    with Renderer(
        device, frame, objects, view, SETTINGS, background=background, **kwargs
    ) as renderer:
        rendered = renderer.render(2, AOVS)
    return [rendered.color, *rendered.aovs.values()]


KINDS: list[dict[str, bool]] = [{}, {"window": True, "gloss": True}]


@pytest.mark.parametrize("kind", KINDS, ids=str)
def test_rays_see_the_light_that_was_clipped(device: ComputeDevice, kind: dict[str, bool]) -> None:
    """Over the same background, the picture equals the unclipped frame's bit for bit."""
    frame = lit(**kind)
    background = np.full((LOOK.height, LOOK.width, 3), 0.2, np.float32)
    truth = pictures(device, frame, LOOK, background)
    found = pictures(device, clipped(frame), LOOK, background)
    dim = replace(frame, color=clipped(frame).picture)
    without = pictures(device, dim, LOOK, background)
    for a, b in zip(truth, found, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(truth[0], without[0])


def test_the_picture_shows_the_color(device: ComputeDevice) -> None:
    """Objects multiply it by the light's ratio."""
    frame = clipped(lit())
    with Renderer(device, frame, [BALL], AROUND, SETTINGS) as renderer:
        shown = renderer.render(2, ["ratio", "coverage"])
    real = shown.aovs["coverage"] == 0.0
    assert (real & (frame.picture == 1.0).all(-1)).any()
    expected = frame.picture * shown.aovs["ratio"]
    np.testing.assert_allclose(shown.color[real], expected[real], rtol=1e-5)


def test_light_that_goes_out_is_a_cut_though_the_color_stays(device: ComputeDevice) -> None:
    """Histories end, and E_R starts again."""
    before = clipped(room_frame(World(), 64, 32, bright_walls))
    seen = replace(before, color=before.picture, clipped=None)
    dark = replace(before, color=before.color * np.float32(0.1), clipped=all_texels(seen))
    with Renderer(device, before, [BALL], LOOK, SETTINGS) as renderer:
        renderer.render(4)
        irradiance = renderer.real_world.irradiance
        assert irradiance is not None
        renderer.load(replace(before))
        counted = device.read(irradiance.mean)[..., 3].max()
        renderer.load(dark)
        left = device.read(irradiance.mean)[..., 3].max()
    assert counted > 2.0 * left
