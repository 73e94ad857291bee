"""Motion of the changes that objects make, on surfaces where it is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.renderer import Renderer
from iprt.trace.carried_motion import CarriedMotion
from tests.filter.gbuffer import Array, GBuffer, read, still_frame, still_motion, upload
from tests.frame.whole_frame import CLAY, METHODS, chosen, rms
from tests.oracles.worlds import World
from tests.worlds import ball, ceiling_lamp, room_frame

Boxes = NDArray[np.float32]
VIEW = View(64, 48, 10.0, -40.0)
SIZE = np.array([0.2, 0.2, 0.2])


def floor(view: View = VIEW, height: float = -1.5) -> GBuffer:
    down = view.directions()[..., 1]
    depth = np.where(down < -0.05, height / np.minimum(down, -0.05), 0.0)
    normal = np.zeros((3, view.height, view.width))
    normal[1] = 1.0
    return GBuffer(view, normal, depth, (depth > 0.0).astype(float))


def boxes(*middles: Array) -> Boxes:
    corners = [[middle - SIZE, middle + SIZE] for middle in middles]
    return np.pad(np.array(corners, np.float32), ((0, 0), (0, 0), (0, 1)))


def carried(
    device: ComputeDevice,
    before: GBuffer,
    now: GBuffer,
    motion: Array,
    boxes_before: Boxes,
    boxes_now: Boxes,
    *,
    moved: bool = True,
) -> Array:
    guide = before.guide(device)
    now.fill(device, guide)
    found = CarriedMotion(device, guide, name="test")
    context = still_frame(device, device.upload("view", before.view.kernel_constants()))
    objects: Any = SimpleNamespace(
        bounds=boxes_now,
        device_bounds=device.upload("bounds", boxes_now),
        bounds_before=device.upload("bounds before", boxes_before),
    )
    surface = upload(device, now.layout, motion)
    context = replace(context, moved=moved)
    result = found.run(surface, objects, context)
    return np.asarray(read(device, now.layout, result), np.float64)


@pytest.mark.parametrize("view", [VIEW, View(96, 48, projection="equirect")])
def test_changes_move_along_the_surface_with_their_object(
    device: ComputeDevice, view: View
) -> None:
    """The part of the step across the floor does not count, and a turned head does."""
    turned = replace(view, yaw_deg=view.yaw_deg + 2.0)
    now, before = floor(view), floor(turned)
    step, middle = np.array([0.1, 0.07, -0.05]), np.array([0.3, -1.0, -1.8])
    point = np.moveaxis(now.position, 0, -1)
    motion = np.moveaxis(turned.project(point), -1, 0)
    result = carried(device, before, now, motion, boxes(middle - step), boxes(middle))
    along = step * [1.0, 0.0, 1.0]
    expected = np.moveaxis(turned.project(point - along), -1, 0)
    inside = (now.depth > 0.0) & (now.depth < 4.0)
    if view.projection == "perspective":
        inside[:8], inside[-8:], inside[:, :8], inside[:, -8:] = False, False, False, False
    assert inside.sum() > 500
    np.testing.assert_allclose(result[:, inside], expected[:, inside], atol=0.02)
    assert np.abs(expected - motion)[:, inside].min(axis=0).max() > 0.3


def test_the_nearest_object_counts(device: ComputeDevice) -> None:
    gbuffer = floor()
    still = still_motion(64, 48)
    step = np.array([0.1, 0.0, 0.0])
    moving, resting = np.array([-0.8, -1.3, -1.8]), np.array([0.9, -1.3, -1.8])
    result = carried(
        device, gbuffer, gbuffer, still, boxes(moving - step, resting), boxes(moving, resting)
    )
    point = np.moveaxis(gbuffer.position, 0, -1)
    expected = np.moveaxis(VIEW.project(point - step), -1, 0)
    close = [np.linalg.norm(point - middle, axis=-1) < 0.4 for middle in (moving, resting)]
    assert min(near.sum() for near in close) > 30
    error = np.abs(result - expected).max(axis=0)[close[0]]
    assert error.max() < 0.03 * np.abs(expected - still).max()
    assert np.abs(result - still)[:, close[1]].max() < 0.03 * np.abs(expected - still).max()


def test_surfaces_keep_their_motion_where_there_is_no_other(device: ComputeDevice) -> None:
    """While objects rest, where the surface ends, and where the picture does."""
    gbuffer = floor()
    still = still_motion(64, 48)
    step, middle = np.array([0.4, 0.0, 0.0]), np.array([0.0, -1.2, -1.8])
    moves = (boxes(middle - step), boxes(middle))
    rested = carried(device, gbuffer, gbuffer, still, *moves, moved=False)
    np.testing.assert_allclose(rested, still)
    right = replace(gbuffer, ids=np.where(np.arange(64) < 32, 0.0, gbuffer.ids))
    result = carried(device, right, gbuffer, still, *moves)
    at_edge = np.zeros((48, 64), bool)
    at_edge[20:, 33:36] = True
    np.testing.assert_allclose(result[:, at_edge], still[:, at_edge])
    outside = carried(device, gbuffer, gbuffer, still, *moves)[:, -4:, 0]
    np.testing.assert_allclose(outside, still[:, -4:, 0])


def test_a_moving_shadow_is_as_sharp_as_a_still_one(device: ComputeDevice) -> None:
    """A ball slides at a tenth of its width per frame; lag would leave its shadow behind."""
    frame = room_frame(World(), 256, 128, ceiling_lamp)
    places = [ball((-0.5 + 0.05 * i, -1.1, -1.4), 0.25, CLAY, subdivisions=3) for i in range(16)]

    def ratio(renderer: Renderer) -> Array:
        return np.asarray(renderer.render(0, ("ratio",)).aovs["ratio"].mean(-1, dtype=float))

    sure = chosen(METHODS[0], fading=0.0, seed=5, trace={"rays": 32, "object_rays": 1})
    with Renderer(device, frame, places[-1:], VIEW, sure) as renderer:
        renderer.render(4)
        truth = ratio(renderer)
        cover = renderer.render(0, ("coverage",)).aovs["coverage"]
    errors, lengths = [], []
    for path in (places[-1:] * len(places), places):
        with Renderer(device, frame, path[:1], VIEW, chosen(METHODS[0])) as renderer:
            for place in path:
                renderer.move([place])
                renderer.step()
            errors.append(rms((ratio(renderer) - truth)[cover == 0.0]))
            method: Any = renderer.method
            certainty = device.read(method.real_pixels.accumulated.certainty)
            lengths.append(renderer.layout.interior(certainty)[1].max())
    assert truth[cover == 0.0].min() < 0.6
    assert errors[1] < 1.5 * errors[0]
    # At least a fifth of the mean is new while objects move, else a tenth.
    assert lengths[1] < 9.1 < 12.0 < lengths[0]
