"""Virtual objects on the device, from the rasterizer to planes, against analytic solids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.geometry.material import Material, material_table
from iprt.geometry.mesh import Instance
from iprt.raster.layers import ObjectLayers
from iprt.world.objects.object_layers import TracedLayers, VisibleLayer
from iprt.world.real.panorama import Panorama
from tests.oracles.worlds import Box, Solid, Sphere, World
from tests.raster.shapes import rasterizer
from tests.view.layers import no_edges
from tests.worlds import Float, ball, cuboid, room_frame

pytestmark = pytest.mark.gl

SOLIDS: tuple[Solid, ...] = (
    Sphere((0.35, -0.1, -1.3), 0.4),
    Box((-0.6, 0.2, -1.6), (0.3, 0.25, 0.2)),
    Sphere((-0.2, -0.1, 1.5), 0.3),  # behind the camera, across the seam
)
MATERIALS = (
    Material(albedo=(0.8, 0.3, 0.1)),
    Material("conductor", (0.9, 0.8, 0.7), alpha=0.3),
    Material("plastic", (0.1, 0.5, 0.2), alpha=0.15),
)
VIEWS = [
    View(96, 72, yaw_deg=-4.0, pitch_deg=3.0, fov_y_deg=70.0),
    View(128, 64, projection="equirect"),
]
views = pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.projection)
SAGITTA = 2e-3
"""How far the balls' facets lie below the spheres, of their radius."""


def instances(solids: Sequence[Solid] = SOLIDS) -> list[Instance]:
    return [
        ball(solid.centre, solid.radius, material)
        if isinstance(solid, Sphere)
        else cuboid(solid.centre, solid.half, material)
        for solid, material in zip(solids, MATERIALS, strict=False)
    ]


@dataclass(frozen=True)
class Seen:
    """What rays from the capture centre first meet: distances in and out, normals, which solid."""

    enter: Float
    leave: Float
    normal: Float
    which: NDArray[np.int64]

    @property
    def any(self) -> NDArray[np.bool_]:
        return np.isfinite(self.enter)


def see(d: Float, solids: Sequence[Solid] = SOLIDS) -> Seen:
    o = np.zeros_like(d)
    rays = [solid.interval(o, d) for solid in solids]
    enter = np.stack([np.where(t0 > 0.0, t0, np.inf) for t0, *_ in rays])
    which = enter.argmin(0)

    def nearest(index: int) -> Float:
        values = np.stack([ray[index] for ray in rays])
        chosen = which[None, ..., None] if values.ndim > enter.ndim else which[None]
        return np.asarray(np.take_along_axis(values, chosen, 0)[0])

    return Seen(enter.min(0), nearest(1), nearest(2), which)


def samples(view: View, count: int) -> Float:
    """(count², H, W, 3) directions through a grid over each pixel."""
    x, y = np.meshgrid(np.arange(view.width), np.arange(view.height))
    steps = (np.arange(count) + 0.5) / count
    return np.stack(
        [view.unproject(np.stack([x + dx, y + dy], -1)) for dy in steps for dx in steps]
    )


def steady(view: View) -> tuple[Seen, NDArray[np.bool_]]:
    """What pixel centres see, and where all of the pixel sees the same face of the same solid."""
    centre, around = see(view.directions()), see(samples(view, 3))
    same = (around.any == centre.any).all(0) & (around.which == centre.which).all(0)
    bend = (around.normal * centre.normal).sum(-1).min(0)
    return centre, same & (~centre.any | (bend > 0.7))


def rasterized(
    view: View,
    chosen: list[Instance],
    *,
    surface: NDArray[np.float32] | None = None,
    previous: View | None = None,
) -> ObjectLayers:
    with rasterizer(chosen) as opened:
        if surface is not None:
            opened.set_surface(surface)
        return opened.render(view, previous, shade=True)


def visible(device: ComputeDevice, layers: ObjectLayers, view: View) -> VisibleLayer:
    equirect = view.projection == "equirect"
    layout = PlaneLayout.of(view)
    layer = VisibleLayer(device, layout, no_edges(device, view), equirect=equirect)
    constants = device.upload("view", view.kernel_constants())
    layer.load(layers, constants, device.upload("materials", material_table(MATERIALS)))
    return layer


def traced(device: ComputeDevice, layers: ObjectLayers, view: View) -> TracedLayers:
    layer = TracedLayers(device, view, "test layers")
    layer.load(layers, device.upload("view", view.kernel_constants()))
    return layer


def image(device: ComputeDevice, layer: VisibleLayer, name: str) -> Float:
    """(H, W) or (H, W, C)."""
    _, height, width, _ = layer.display.shape
    planes = PlaneLayout(width, height).interior(device.read(getattr(layer, name)))
    channels = np.moveaxis(planes.astype(np.float64), 0, -1)
    return channels[..., 0] if channels.shape[-1] == 1 else channels


# The visible layer ---------------------------------------------------------------------------


@views
def test_visible_surfaces_are_the_solids(device: ComputeDevice, view: View) -> None:
    before = replace(view, yaw_deg=view.yaw_deg + 6.0)
    layer = visible(device, rasterized(view, instances(), previous=before), view)
    seen, clear = steady(view)
    depth = image(device, layer, "depth")
    inner = clear & seen.any
    assert {*seen.which[inner]} == ({0, 1} if view.projection == "perspective" else {0, 1, 2})
    d, which = view.directions(), seen.which[inner]
    facing = -(seen.normal * d).sum(-1)[inner]
    assert (np.abs(depth[inner] - seen.enter[inner]) * facing).max() < SAGITTA * 0.4
    normal = image(device, layer, "normal")[inner]
    assert (normal * seen.normal[inner]).sum(-1).min() > np.cos(0.02)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(image(device, layer, "id")[inner], 1 + which)
    albedo = np.array([m.albedo for m in MATERIALS])
    np.testing.assert_allclose(image(device, layer, "albedo")[inner], albedo[which], atol=1e-6)
    roughness = np.array([1.0, 0.3, 0.15])  # a diffuse surface counts as entirely rough
    np.testing.assert_allclose(image(device, layer, "roughness")[inner], roughness[which])
    shift = image(device, layer, "motion")[inner] - before.project(d[inner])
    shift[:, 0] -= view.width * np.round(shift[:, 0] / view.width)
    assert np.abs(shift).max() < 1e-2
    # The position, which all passes compare, lies on the ball.
    on_ball = inner & (seen.which == 0)
    assert isinstance(SOLIDS[0], Sphere)
    away = np.linalg.norm((d * depth[..., None])[on_ball] - SOLIDS[0].centre, axis=-1)
    np.testing.assert_allclose(away, SOLIDS[0].radius, rtol=2 * SAGITTA)


@views
def test_real_surfaces_hide_objects(device: ComputeDevice, view: View) -> None:
    """A wall stands through the ball: what is behind it is not visible, but is still traced."""
    world = World(high=(0.35, 1.3, 3.0))
    frame = room_frame(world, 256, 128, lambda points, normals: np.ones_like(points))
    panorama = Panorama(device, 256, 128)
    panorama.load(frame)
    chosen = instances(SOLIDS[:1])
    layers = rasterized(view, chosen, surface=device.read(panorama.surface))
    layer = visible(device, layers, view)
    rays = samples(view, 5)
    wall, _, _ = world.first_hit(np.zeros_like(rays), rays)
    enter = see(rays, SOLIDS[:1]).enter
    area = (enter < wall).mean(0)
    coverage = image(device, layer, "coverage")
    hidden = (np.isfinite(enter) & (enter > wall + 0.03)).all(0)
    shown = (enter < wall - 0.03).all(0)
    assert hidden.sum() > 15
    assert shown.sum() > 60
    assert not coverage[hidden].any()
    assert (coverage[shown] == 1.0).all()
    assert abs((coverage - area).mean()) < 0.002
    assert (image(device, layer, "depth")[hidden] == 0.0).all()
    back = traced(device, layers, view)
    assert (device.read(back.geometry)[:, hidden, 3] > 0.0).all()


# Layers that rays march through --------------------------------------------------------------


@views
def test_traced_planes_touch_the_solids(device: ComputeDevice, view: View) -> None:
    """In front and at the back, all over each texel: the planes are tangent to the surfaces."""
    layers = rasterized(view, instances())
    planes = device.read(traced(device, layers, view)._planes)
    centre, clear = steady(view)
    clear &= centre.any
    for d in samples(view, 2):
        seen = see(d)
        for side, wanted in enumerate((seen.enter, seen.leave)):
            g = planes[:, :, side, :3]
            normal = g / np.maximum(np.linalg.norm(g, axis=-1, keepdims=True), 1e-9)
            steep = clear & (np.abs((normal * d).sum(-1)) > 0.4)
            if side == 1:  # a ball ends where the ray leaves it, a texel may see two faces of a box
                steep &= centre.which != 1
            radius = 1.0 / (g * d).sum(-1)[steep]
            assert steep.sum() > 60
            np.testing.assert_allclose(radius, wanted[steep], rtol=0.015)
    d = view.directions()
    solid = planes[..., 3].min(-1) > 0.0
    for side in (0, 1):
        at_centre = 1.0 / (planes[:, :, side, :3] * d).sum(-1)[solid]
        np.testing.assert_allclose(at_centre, planes[:, :, side, 3][solid], rtol=1e-4)


@views
def test_ranges_hold_the_solids(device: ComputeDevice, view: View) -> None:
    layers = rasterized(view, instances())
    layer = traced(device, layers, view)
    ranges = device.read(layer._range)[: layer.width * layer.height]
    low, high = np.moveaxis(ranges.reshape(layer.height, layer.width, 2), -1, 0)
    solid = (layers.front.geometry[..., 3] > 0.0) & (layers.back.geometry[..., 3] > 0.0)
    np.testing.assert_array_equal(np.isfinite(low), solid)
    np.testing.assert_array_equal(np.isposinf(low) & np.isneginf(high), ~solid)
    borrowed = (layers.front.geometry[..., 3] > 0.0) & ~solid
    assert borrowed.sum() > 10
    assert not device.read(layer._planes)[~solid].any()
    _, clear = steady(view)
    for d in samples(view, 3):
        seen = see(d)
        inside = clear & seen.any
        assert (low <= seen.enter * (1.0 + 1e-3))[inside].all()
        assert (high >= seen.leave * (1.0 - 5e-3))[inside].all()
    # A plane seen edge-on does not run away within its texel.
    reach = 6.001 * layer.footprint
    assert (low >= layers.front.geometry[..., 3] * (1.0 - reach))[solid].all()
    assert (high <= layers.back.geometry[..., 3] * (1.0 + reach))[solid].all()
    inside = clear & solid
    excess = (high - low)[inside] - (seen.leave - seen.enter)[inside]
    assert np.median(excess) < 2.5 * layer.footprint
