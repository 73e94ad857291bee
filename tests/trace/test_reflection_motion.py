"""Motion of reflections against mirrors whose images are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.trace.reflection_motion import ReflectionMotion
from tests.filter.gbuffer import Array, GBuffer, read, upload

HIT = 1.5


def wall(view: View, normal: Array, offset: float) -> GBuffer:
    """The plane normal . x = offset in every pixel that looks at its front."""
    directions = np.moveaxis(view.directions(), -1, 0)
    facing = np.einsum("c,chw->hw", normal, directions)
    depth = np.where(facing < -0.05, offset / np.minimum(facing, -0.05), 0.0)
    normals = normal[:, None, None] * np.ones(depth.shape)
    return GBuffer(view, normals, depth, np.ones(depth.shape))


def moved(
    device: ComputeDevice,
    before: GBuffer,
    now: GBuffer,
    motion: Array,
    *,
    alpha: float = 0.0,
    hit: float = HIT,
) -> Array:
    guide = before.guide(device)
    now.fill(device, guide)
    height, width = now.depth.shape
    result = ReflectionMotion(device, guide).run(
        upload(device, now.layout, motion),
        upload(device, now.layout, np.full((1, height, width), alpha)),
        upload(device, now.layout, np.full((1, height, width), hit)),
        device.upload("view", before.view.kernel_constants()),
    )
    return read(device, now.layout, result)


def surface_motion(before: GBuffer, now: GBuffer, shift: Array) -> Array:
    """(2, H, W) where points of a surface that moved by `shift` were; -1e9 where none is."""
    at = before.view.project(np.moveaxis(now.position, 0, -1) - shift)
    return np.where(now.depth > 0.0, np.moveaxis(at, -1, 0), -1e9)


VIEWS = [View(48, 40, 10.0, 5.0, fov_y_deg=50.0), View(96, 48, projection="equirect")]


@pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.projection)
def test_sliding_mirror_leaves_its_image_where_it_is(device: ComputeDevice, view: View) -> None:
    gbuffer = wall(view, np.array([0.0, 0.0, 1.0]), -2.0)
    shift = np.array([0.06, -0.04, 0.0])
    surface = surface_motion(gbuffer, gbuffer, shift)
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    inside = (gbuffer.depth > 0.0) & (gbuffer.depth < 4.0)
    inside &= (np.minimum(x, view.width - x) > 4) & (np.minimum(y, view.height - y) > 4)
    assert inside.sum() > 300
    result = moved(device, gbuffer, gbuffer, surface)
    np.testing.assert_allclose(result[:, inside], np.stack([x, y])[:, inside], atol=0.02)
    assert np.abs(surface - np.stack([x, y]))[:, inside].max() > 0.3


@pytest.mark.parametrize("turn", [0.0, 3.0])
def test_turned_head_changes_nothing(device: ComputeDevice, turn: float) -> None:
    """Surface and image lie on one ray from the capture centre."""
    normal = np.array([0.2, 0.1, 0.97]) / np.linalg.norm([0.2, 0.1, 0.97])
    now = wall(VIEWS[0], normal, -2.0)
    before = wall(replace(now.view, yaw_deg=now.view.yaw_deg + turn), normal, -2.0)
    surface = surface_motion(before, now, np.zeros(3))
    result = moved(device, before, now, surface)
    np.testing.assert_allclose(result, surface, atol=0.02)


@pytest.mark.parametrize(("alpha", "share"), [(0.0, 1.0), (0.25, 0.6036), (1.0, 0.0)])
def test_rough_reflections_stay_with_the_surface(
    device: ComputeDevice, alpha: float, share: float
) -> None:
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    surface = surface_motion(gbuffer, gbuffer, np.array([0.06, 0.0, 0.0]))
    mirror = moved(device, gbuffer, gbuffer, surface)
    result = moved(device, gbuffer, gbuffer, surface, alpha=alpha)
    expected = surface + share * (mirror - surface)
    np.testing.assert_allclose(result[:, 5:-5, 5:-5], expected[:, 5:-5, 5:-5], atol=0.01)


def test_bent_mirror_carries_its_image_along(device: ComputeDevice) -> None:
    """A ball that slides by s moves an image by (1 - m) s, m = 1 / (2 h / radius + 1)."""
    view, radius, shift = View(64, 48, fov_y_deg=30.0), 0.5, np.array([0.02, 0.0, 0.0])

    def ball(centre: Array) -> GBuffer:
        d = np.moveaxis(view.directions(), -1, 0)
        along = np.einsum("c,chw->hw", centre, d)
        inside = along**2 - centre @ centre + radius**2
        depth = np.where(inside > 0.0, along - np.sqrt(np.maximum(inside, 0.0)), 0.0)
        normal = (d * depth - centre[:, None, None]) / radius
        return GBuffer(view, np.where(depth > 0.0, normal, 0.0), depth, np.ones(depth.shape))

    centre = np.array([0.0, 0.0, -2.0])
    before, now = ball(centre - shift), ball(centre)
    surface = surface_motion(before, now, shift)
    result = moved(device, before, now, surface)
    middle = (slice(None), slice(20, 28), slice(28, 36))
    still = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5))
    m = 1.0 / (2.0 * HIT / radius + 1.0)
    # Farther away by the image's distance, the same step is seen smaller.
    away = 1.5 / (1.5 + m * HIT)
    expected = (still - surface)[0][middle[1:]].mean() * (1.0 - m) * away
    step = (still - result)[0][middle[1:]].mean()
    np.testing.assert_allclose(step, expected, rtol=0.1)


def test_nothing_reflected_or_nothing_there(device: ComputeDevice) -> None:
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    surface = surface_motion(gbuffer, gbuffer, np.array([0.06, 0.0, 0.0])).astype(np.float32)
    assert np.array_equal(moved(device, gbuffer, gbuffer, surface, hit=0.0), surface)
    gone = np.full_like(surface, -1e9)
    assert np.array_equal(moved(device, gbuffer, gbuffer, gone), gone)
    other = replace(gbuffer, ids=gbuffer.ids + 1.0)
    assert np.array_equal(moved(device, other, gbuffer, surface), surface)
