"""Light of blocks, reduced to and enlarged from, against planes and edges that are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from pyopencl import cltypes

from iprt.device.compute import ComputeDevice
from iprt.filter.interpolate import NORMAL_SHARPNESS, PLANE_SHARPNESS
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.light_view import block_map, enlarging_size
from tests.oracles.worlds import World
from tests.worlds import Float

VIEWS = {
    "ahead": (View(64, 48), 4),
    "odd": (View(65, 47, yaw_deg=40.0, pitch_deg=-25.0, fov_y_deg=90.0), 4),
    "halves": (View(33, 20, yaw_deg=-100.0), 2),
    "whole": (View(96, 48, projection="equirect"), 4),
    "whole, odd": (View(97, 49, projection="equirect"), 3),
}
views = pytest.mark.parametrize(("view", "scale"), VIEWS.values(), ids=VIEWS)

UP = np.array([0.0, 1.0, 0.0])
FLOOR = -1.5
BOX = World((-2.0, FLOOR, -3.0), (2.0, -FLOOR, 3.0))


@dataclass(frozen=True)
class Surfaces:
    """normal (H, W, 3), depth (H, W), id (H, W) of a layer."""

    normal: Float
    depth: Float
    id: Float


def box_room(view: View, ids: bool = False) -> Surfaces:
    """The inside of a box, seen from the capture centre; with `ids`, each side has its own."""
    t, normal, _ = BOX.first_hit(np.zeros(3), view.directions())
    return Surfaces(normal, t, 4.0 + normal @ [1.0, 2.0, 3.0] if ids else np.ones(t.shape))


def planes(layout: PlaneLayout, image: Float) -> Float:
    image = image if image.ndim == 3 else image[..., None]
    return layout.padded(np.moveaxis(image, -1, 0)).astype(np.float32)


def enlarged(
    device: ComputeDevice,
    view: View,
    scale: int,
    light: Float,
    full: Surfaces,
    blocks: Surfaces,
    *,
    wide: bool | None = None,
) -> Float:
    """(H, W, 3) of light (h, w, 3) of the blocks; by ratios if it has a fourth channel.

    `wide`: many pixels at once; None: if the device likes it.
    """
    wide = device.wide if wide is None else wide
    small = view.reduced(scale)
    layouts = [PlaneLayout.of(v) for v in (view, small)]
    ratio = light.shape[-1] == 4
    defines = {"RATIO": ratio, "WIDE": wide}
    arguments = {}
    for prefix, layout, surfaces in zip(("", "block_"), layouts, (full, blocks), strict=True):
        for name, image in vars(surfaces).items():
            arguments[prefix + name] = device.upload(prefix + name, planes(layout, image))
    rows = light.reshape(-1, 4).astype(np.float32) if ratio else planes(layouts[1], light)
    shape = (view.height * view.width, 4) if ratio else layouts[0].shape(3)
    result = device.zeros("light", shape)
    device.kernel("compositing/enlarge.cl", "enlarge", defines)(
        enlarging_size(view, small, wide=wide),
        arguments,
        view=device.upload("view", view.kernel_constants()),
        block_view=device.upload("block view", small.kernel_constants()),
        to_block=cltypes.make_float4(*block_map(view, small)),
        **layouts[0].arguments(),
        block_width=small.width,
        block_height=small.height,
        block_light=device.upload("light of blocks", rows),
        light=result,
        normal_sharpness=NORMAL_SHARPNESS,
        plane_sharpness=PLANE_SHARPNESS,
    )
    found = device.read(result)
    if ratio:
        assert (found[:, 3] == 1.0).all()
        return np.asarray(found[:, :3].reshape(view.height, view.width, 3))
    return np.asarray(layouts[0].image(found, slice(0, 3)))


@views
def test_the_reduced_view_sees_the_same(view: View, scale: int) -> None:
    small = view.reduced(scale)
    x_scale, y_scale, x_offset, y_offset = block_map(view, small)
    points = np.random.default_rng(0).uniform((0, 0), (view.width, view.height), (50, 2))
    there = points * (x_scale, y_scale) + (x_offset, y_offset)
    np.testing.assert_allclose(small.unproject(there), view.unproject(points), atol=1e-12)
    assert small.width == -(-view.width // scale)
    assert small.height == -(-view.height // scale)
    assert (there >= -1e-9).all()
    assert (there <= (small.width + 1e-9, small.height + 1e-9)).all()


@views
def test_a_ratio_of_1_is_exact(device: ComputeDevice, view: View, scale: int) -> None:
    small = view.reduced(scale)
    ratio = np.ones((small.height, small.width, 4))
    found = enlarged(device, view, scale, ratio, box_room(view), box_room(small))
    assert (found == 1.0).all()


@views
def test_light_ends_where_its_surface_ends(device: ComputeDevice, view: View, scale: int) -> None:
    """Each side of the box has a light of its own, which no pixel of another side may show."""
    small = view.reduced(scale)
    full, blocks = box_room(view), box_room(small)

    def light_of(surfaces: Surfaces) -> Float:
        return np.asarray(1.0 + abs(surfaces.normal) * (1.0, 2.0, 3.0))

    ratio = np.concatenate([light_of(blocks), np.ones((*blocks.depth.shape, 1))], axis=-1)
    found = enlarged(device, view, scale, ratio, full, blocks)
    # Some corners of the box have no block of their own.
    off = abs(found - light_of(full)).max(axis=-1)
    assert (off > 1e-3).mean() < 0.02


@views
@pytest.mark.parametrize("channels", [3, 4])
def test_many_pixels_at_once_are_the_same(
    device: ComputeDevice, view: View, scale: int, channels: int
) -> None:
    small = view.reduced(scale)
    light = np.random.default_rng(5).uniform(0.5, 2.0, (small.height, small.width, channels))
    full, blocks = box_room(view, ids=True), box_room(small, ids=True)
    full.id[5:9, 3:20] = 0.0
    many, one = (
        enlarged(device, view, scale, light, full, blocks, wide=wide) for wide in (True, False)
    )
    np.testing.assert_allclose(many, one, rtol=1e-3, atol=1e-5)


def test_ids_do_not_mix(device: ComputeDevice) -> None:
    """On one plane, two materials side by side."""
    view, scale = View(64, 48, pitch_deg=-60.0), 4
    small = view.reduced(scale)

    def surfaces(of: View) -> Surfaces:
        d = of.directions()
        points = d * (FLOOR / d[..., 1])[..., None]
        ids = np.where(points[..., 0] > 0.05, 2.0, 1.0)
        return Surfaces(np.broadcast_to(UP, d.shape), FLOOR / d[..., 1], ids)

    full, blocks = surfaces(view), surfaces(small)
    light = np.repeat(blocks.id[..., None], 3, axis=-1)
    found = enlarged(device, view, scale, light, full, blocks)
    near = np.abs(found[..., 0] - full.id)
    assert (near < 1e-3).mean() > 0.97
    assert near.max() <= 1.0


def test_light_is_blended_along_a_plane(device: ComputeDevice) -> None:
    """Linear between the centres of blocks, which light that is linear in the picture shows."""
    view, scale = View(64, 48, pitch_deg=-90.0, fov_y_deg=40.0), 4
    small = view.reduced(scale)

    def surfaces(of: View) -> Surfaces:
        d = of.directions()
        return Surfaces(np.broadcast_to(UP, d.shape), FLOOR / d[..., 1], np.ones(d.shape[:2]))

    def ramp(of: View) -> Float:
        y, x = np.indices((of.height, of.width)) + 0.5
        return np.stack([x / of.width, y / of.height, 1.0 + 0.0 * x], axis=-1)

    found = enlarged(device, view, scale, ramp(small), surfaces(view), surfaces(small))
    inside = np.s_[scale:-scale, scale:-scale]
    np.testing.assert_allclose(found[inside], ramp(view)[inside], atol=2e-3)


def test_nothing_is_lit_where_nothing_is(device: ComputeDevice) -> None:
    view, scale = View(32, 24), 4
    small = view.reduced(scale)
    full, blocks = box_room(view), box_room(small)
    full.id[:, :16] = 0.0
    light = np.random.default_rng(1).uniform(1.0, 2.0, (small.height, small.width, 3))
    found = enlarged(device, view, scale, light, full, blocks)
    assert not found[:, :16].any()
    assert (found[:, 16:] >= 1.0).all()
    blocks.id[:] = 0.0
    # At the border, where all four blocks are one, they agree whatever they show.
    found = enlarged(device, view, scale, light, full, blocks)[scale:-scale, scale:-scale]
    assert not found.any()


def test_the_seam_is_no_edge(device: ComputeDevice) -> None:
    """Around the capture centre, all columns are alike: turned light gives the same, turned."""
    view, scale, turn = View(96, 48, projection="equirect"), 4, 5
    small = view.reduced(scale)

    def sphere(of: View) -> Surfaces:
        d = of.directions()
        return Surfaces(-d, np.full(d.shape[:2], 4.0), np.ones(d.shape[:2]))

    full, blocks = sphere(view), sphere(small)
    light = np.random.default_rng(4).uniform(0.0, 2.0, (small.height, small.width, 3))
    found = enlarged(device, view, scale, light, full, blocks)
    turned = enlarged(device, view, scale, np.roll(light, turn, axis=1), full, blocks)
    np.testing.assert_allclose(turned, np.roll(found, turn * scale, axis=1), atol=1e-4)
