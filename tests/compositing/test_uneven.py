"""Relighting of pixels that blend texels of several planes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.compositing.composite import Composite
from iprt.compositing.real_layer import UNEVEN, RealLayer
from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from tests.compositing.layers import loaded
from tests.filter.gbuffer import upload
from tests.oracles.worlds import World
from tests.worlds import Float, bright_walls, panorama_at, room_frame, sphere_frame

VIEW = View(160, 120, pitch_deg=-10.0, fov_y_deg=50.0)
COLUMNS, ROWS = 64, 32


def applied(
    device: ComputeDevice, frame: Frame, ratio: Float, *, gloss: bool = False
) -> tuple[Float, Float]:
    """Return the real layer's factors (H, W, 3) in VIEW, and `RealLayer.other_pixel` (H, W).

    With gloss, all radiance is a highlight that changes by the ratio.
    """
    layout = PlaneLayout.of(VIEW)
    layer = RealLayer(device, layout, name="real", edges=True)
    view = device.upload("view", VIEW.kernel_constants())
    layer.run(loaded(device, frame), view, view)
    color = layout.interior(device.read(layer.color))
    highlight = {}
    if gloss:
        change = color * (np.moveaxis(ratio, -1, 0) - 1.0)
        highlight["base"] = upload(device, layout, np.zeros_like(color))
        highlight["change"] = upload(device, layout, change)
        ratio = np.ones_like(ratio)
    four = np.concatenate([ratio, np.ones((*ratio.shape[:2], 1))], axis=-1).astype(np.float32)
    composite = Composite(device, layout)
    composite.run(
        layer.color,
        other=layer.other,
        other_pixel=layer.other_pixel,
        corner=layer.corner,
        ratio=device.upload("ratio", four.reshape(-1, 4)),
        **highlight,
    )
    relit = device.read(composite.picture)[..., :3].astype(np.float64)
    return relit / np.moveaxis(color, 0, -1), device.read(layer.other_pixel).reshape(
        VIEW.height, VIEW.width
    )


def of_nearest(texels: Float) -> Float:
    """Return values (H, W, 3) of the texel in the middle of each pixel of VIEW."""
    d = VIEW.directions()
    column = (np.arctan2(d[..., 0], -d[..., 2]) / (2.0 * np.pi) + 0.5) * COLUMNS
    row = np.arccos(np.clip(d[..., 1], -1.0, 1.0)) / np.pi * ROWS
    return np.asarray(texels[row.astype(int), column.astype(int)])


@pytest.mark.parametrize("gloss", [False, True])
def test_rough_surfaces_are_relit_as_the_relit_panorama_looks(
    device: ComputeDevice, gloss: bool
) -> None:
    """Facets in all directions, each with a ratio: as if texels had been relit, then blended."""
    rng = np.random.default_rng(3)
    frame = sphere_frame(2.0, COLUMNS, ROWS, 1.0)
    color = rng.uniform(0.2, 1.0, (ROWS, COLUMNS, 1)).repeat(3, -1).astype(np.float32)
    facing = -View(COLUMNS, ROWS, projection="equirect").directions()
    row, column = np.indices((ROWS, COLUMNS))
    across = np.stack([-facing[..., 2], np.zeros((ROWS, COLUMNS)), facing[..., 0]], axis=-1)
    normal = facing + 0.6 * (-1.0) ** column[..., None] * across
    normal[..., 1] += 0.6 * (-1.0) ** row
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    frame = replace(frame, color=color, normal=normal.astype(np.float32))
    of_texels = rng.uniform(0.3, 1.0, (ROWS, COLUMNS, 3))
    ratio, marks = applied(device, frame, of_nearest(of_texels), gloss=gloss)
    d = VIEW.directions()
    expected = panorama_at(color * of_texels, d) / panorama_at(color, d)
    inside = np.s_[20:-20, 20:-20]  # where the view shows all four texels
    assert (marks[inside] == UNEVEN).all()
    np.testing.assert_allclose(ratio[inside], expected[inside], atol=1e-4)


def test_shadows_on_one_plane_stay_as_they_are(device: ComputeDevice) -> None:
    """Only the creases of a box room are uneven, and there by the other plane's ratio alone."""
    world = World()
    frame = room_frame(world, COLUMNS, ROWS, bright_walls)
    d = VIEW.directions()
    distance, normal, _ = world.first_hit(np.zeros(3), d)
    fine = np.where(np.sin(60.0 * distance) > 0.0, 0.4, 0.9)[..., None] * np.ones(3)
    ratio, marks = applied(device, frame, fine)
    texels = world.first_hit(np.zeros(3), View(COLUMNS, ROWS, projection="equirect").directions())
    normals = np.unique(normal.reshape(-1, 3), axis=0)
    shares = [panorama_at(1.0 * (texels[1] == n).all(-1, keepdims=True), d) for n in normals]
    pure = np.max(shares, axis=0)[..., 0] > 1.0 - 1e-6
    assert 0.2 < pure.mean() < 0.95
    assert (marks[pure] == -1).all()
    np.testing.assert_allclose(ratio[pure], fine[pure], rtol=1e-6)
    assert (marks[~pure] == UNEVEN).mean() > 0.99
