"""Motion of reflections against mirrors whose images are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.trace.reflection_motion import ReflectionMotion
from tests.filter.gbuffer import Array, GBuffer, read, still_motion, upload

HIT = 1.5


def wall(view: View, normal: Array, offset: float) -> GBuffer:
    """The plane normal . x = offset in every pixel that looks at its front."""
    directions = np.moveaxis(view.directions(), -1, 0)
    facing = np.einsum("c,chw->hw", normal, directions)
    depth = np.where(facing < -0.05, offset / np.minimum(facing, -0.05), 0.0)
    normals = normal[:, None, None] * np.ones(depth.shape)
    return GBuffer(view, normals, depth, np.ones(depth.shape))


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def moved(
    device: ComputeDevice,
    before: GBuffer,
    now: GBuffer,
    motion: Array,
    *,
    alpha: float = 0.0,
    hit: float = HIT,
    seen: tuple[Array, Array] | None = None,
) -> Array:
    guide = before.guide(device)
    now.fill(device, guide)
    height, width = now.depth.shape
    rays = None
    if seen is not None:
        rays = upload(device, now.layout, seen[0]), upload(device, now.layout, seen[1])
    result = ReflectionMotion(device, guide, glass=seen is not None).run(
        upload(device, now.layout, motion),
        upload(device, now.layout, np.full((1, height, width), alpha)),
        upload(device, now.layout, np.full((1, height, width), hit)),
        device.upload("view", before.view.kernel_constants()),
        rays,
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


@pytest.mark.parametrize("alpha", [0.0, 0.02, 0.25, 1.0])
def test_rough_reflections_stay_with_the_surface(device: ComputeDevice, alpha: float) -> None:
    """The surface's own motion counts more where its error is small relative to the lobe."""
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    shift = np.array([0.06, 0.0, 0.0])
    surface = surface_motion(gbuffer, gbuffer, shift)
    mirror = moved(device, gbuffer, gbuffer, surface)
    result = moved(device, gbuffer, gbuffer, surface, alpha=alpha)
    flip = np.array([1.0, 1.0, -1.0])
    point = np.moveaxis(gbuffer.position, 0, -1)
    reflected = point + HIT * unit(point) * flip
    off = unit(point - shift) * flip - unit(reflected - (point - shift))
    lag = 36.0 * (off**2).sum(axis=-1)
    share = lag / (lag + 8.0 * alpha**2)
    expected = surface + share * (mirror - surface)
    np.testing.assert_allclose(result[:, 5:-5, 5:-5], expected[:, 5:-5, 5:-5], atol=0.03)


def test_reflections_that_are_not_found_stay_with_the_surface(device: ComputeDevice) -> None:
    """By the share of the error that remains after three steps of eight pixels."""
    view = replace(VIEWS[0], width=144, height=120)
    gbuffer = wall(view, np.array([0.0, 0.0, 1.0]), -2.0)
    shift = np.array([0.8, 0.0, 0.0])
    surface = surface_motion(gbuffer, gbuffer, shift)
    result = moved(device, gbuffer, gbuffer, surface)
    flip = np.array([1.0, 1.0, -1.0])
    point = np.moveaxis(gbuffer.position, 0, -1)
    reflected = point + HIT * unit(point) * flip

    def missed(at: Array) -> Array:
        ray = view.unproject(at)
        origin = ray * (-2.0 / ray[..., 2:])
        return np.asarray(((ray * flip - unit(reflected - origin)) ** 2).sum(axis=-1))

    at = np.moveaxis(surface, 0, -1)
    way = still_motion(view.width, view.height).transpose(1, 2, 0) - at
    found = at + 24.0 * unit(way)
    share = 1.0 - missed(found) / missed(at)
    inside = (slice(50, 70), slice(100, 130))
    assert (np.linalg.norm(way, axis=-1)[inside] > 30.0).all()
    assert (share[inside] < 0.95).all()
    expected = np.moveaxis(at + share[..., None] * (found - at), -1, 0)
    np.testing.assert_allclose(result[:, *inside], expected[:, *inside], atol=0.6)


def test_an_objects_reflection_in_itself_moves_with_it(device: ComputeDevice) -> None:
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    shift = np.array([0.06, 0.02, 0.0])
    surface = surface_motion(gbuffer, gbuffer, shift)
    result = moved(device, gbuffer, gbuffer, surface, hit=-HIT)
    point = np.moveaxis(gbuffer.position, 0, -1)
    image = point + HIT * unit(point)
    expected = np.moveaxis(gbuffer.view.project(image - shift), -1, 0)
    np.testing.assert_allclose(result[:, 6:-6, 6:-6], expected[:, 6:-6, 6:-6], atol=0.03)
    assert np.abs(expected - surface)[:, 6:-6, 6:-6].max() > 0.3


def test_ball_shows_the_same_points(device: ComputeDevice) -> None:
    """The mirrored ray through the returned position meets the same point."""
    view, radius, shift = View(96, 72, fov_y_deg=30.0), 0.4, np.array([0.02, -0.01, 0.02])

    def mirrored(at: Array, centre: Array) -> tuple[Array, Array]:
        """Points of the ball on rays (..., 3), NaN where they miss it, and mirrored directions."""
        along = at @ centre
        inside = along**2 - centre @ centre + radius**2
        with np.errstate(invalid="ignore"):
            point = at * (along - np.sqrt(inside))[..., None]
        normal = (point - centre) / radius
        return point, at - 2.0 * (at * normal).sum(axis=-1, keepdims=True) * normal

    def ball(centre: Array) -> GBuffer:
        point = mirrored(view.directions(), centre)[0]
        depth = np.nan_to_num(np.linalg.norm(point, axis=-1))
        normal = np.moveaxis(np.nan_to_num((point - centre) / radius), -1, 0)
        return GBuffer(view, normal, depth, (depth > 0.0).astype(float))

    centre = np.array([0.0, 0.0, -2.0])
    before, now = ball(centre - shift), ball(centre)
    surface = surface_motion(before, now, shift)
    result = np.moveaxis(moved(device, before, now, surface), 0, -1)
    point, direction = mirrored(view.directions(), centre)
    reflected = point + HIT * direction

    def missed(at: Array) -> Array:
        origin, ray = mirrored(unit(view.unproject(at)), centre - shift)
        return np.linalg.norm(ray - unit(reflected - origin), axis=-1)

    facing = (unit(point - centre) * -view.directions()).sum(axis=-1)
    inner = np.nan_to_num(facing) > 0.4
    assert inner.sum() > 1000
    still = missed(np.moveaxis(surface, 0, -1))[inner]
    # The rest is mostly from normals of whole pixels.
    assert np.median(missed(result)[inner]) < 0.15 * np.median(still)
    assert np.quantile(missed(result)[inner], 0.99) < 0.5 * np.median(still)


def test_nothing_reflected_or_nothing_there(device: ComputeDevice) -> None:
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    surface = surface_motion(gbuffer, gbuffer, np.array([0.06, 0.0, 0.0])).astype(np.float32)
    assert np.array_equal(moved(device, gbuffer, gbuffer, surface, hit=0.0), surface)
    gone = np.full_like(surface, -1e9)
    assert np.array_equal(moved(device, gbuffer, gbuffer, gone), gone)
    other = replace(gbuffer, ids=gbuffer.ids + 1.0)
    assert np.array_equal(moved(device, other, gbuffer, surface), surface)


# Refraction ----------------------------------------------------------------------------------

POWER = 0.8
"""Of the thin lenses in these tests, 1/m."""


def lens(gbuffer: GBuffer, centre: Array, *, stripes: float, mirrored: float = 0.0) -> Array:
    """(10, H, W) rays behind a thin lens in the plane of a wall, which bends them to its centre.

    `stripes`: contrast of the picture of a plane 1.5 m behind the lens, and `mirrored` of the
    reflection, which is HIT away.
    """
    point = gbuffer.position
    inside = gbuffer.depth > 0.0
    bend = POWER * (point - centre[:, None, None])
    bend[2] = 0.0
    direction = point / np.abs(point[2]) - bend
    direction /= np.linalg.norm(direction, axis=0)
    distance = np.where(inside, -1.5 / direction[2], 0.0)
    target = point + distance * direction
    waves = np.sin(20.0 * target[0])
    luminances = 1.0 + np.stack([stripes * waves, mirrored * np.sin(20.0 * point[0])])
    hits = np.full((1, *inside.shape), HIT)
    return np.concatenate([point, direction, distance[None], luminances, hits])


def inner(view: View) -> tuple[slice, slice]:
    return slice(8, view.height - 8), slice(8, view.width - 8)


def test_image_in_a_sliding_lens_is_followed(device: ComputeDevice) -> None:
    """To where the lens bent the view to the same point, by the rays of either picture."""
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    shift = np.array([0.06, -0.02, 0.0])
    surface = surface_motion(gbuffer, gbuffer, shift)
    centre = np.array([0.1, 0.05, -2.0])
    now, before = (lens(gbuffer, at, stripes=5.0) for at in (centre, centre - shift))
    result = moved(device, gbuffer, gbuffer, surface, seen=(now, before))
    # In the plane of the lens, x + 1.5 (x / 2 - POWER (x - centre)) is the point seen.
    slope = 1.0 + 1.5 * (0.5 - POWER)
    point = np.moveaxis(gbuffer.position, 0, -1) + shift * (1.5 * POWER) / slope
    expected = np.moveaxis(gbuffer.view.project(point), -1, 0)
    at = (slice(None), *inner(gbuffer.view))
    np.testing.assert_allclose(result[at], expected[at], atol=0.05)
    assert np.abs(expected - surface)[at].max() > 0.5


@pytest.mark.parametrize(("stripes", "mirrored"), [(0.0, 0.0), (0.2, 0.5)])
def test_reflection_on_glass_is_followed_where_it_has_the_contrast(
    device: ComputeDevice, stripes: float, mirrored: float
) -> None:
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    shift = np.array([0.06, -0.02, 0.0])
    surface = surface_motion(gbuffer, gbuffer, shift)
    centre = np.array([0.1, 0.05, -2.0])
    now, before = (
        lens(gbuffer, at, stripes=stripes, mirrored=mirrored) for at in (centre, centre - shift)
    )
    result = moved(device, gbuffer, gbuffer, surface, seen=(now, before), hit=0.1)
    mirror = moved(device, gbuffer, gbuffer, surface, hit=HIT)
    at = (slice(None), *inner(gbuffer.view))
    np.testing.assert_allclose(result[at], mirror[at], atol=1e-4)


def test_first_picture_of_a_motion_follows_the_surface(device: ComputeDevice) -> None:
    gbuffer = wall(VIEWS[0], np.array([0.0, 0.0, 1.0]), -2.0)
    shift = np.array([0.06, -0.02, 0.0])
    surface = surface_motion(gbuffer, gbuffer, shift)
    now = lens(gbuffer, np.array([0.1, 0.05, -2.0]), stripes=5.0)
    result = moved(device, gbuffer, gbuffer, surface, seen=(now, np.zeros_like(now)))
    np.testing.assert_array_equal(result, surface.astype(np.float32))
