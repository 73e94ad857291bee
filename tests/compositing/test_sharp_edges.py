"""Depth edges at the view's resolution: against a twin, and against the room that is shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.world.real.panorama import Panorama
from tests.compositing.layers import Layer, loaded, show
from tests.oracles import edges
from tests.oracles.worlds import Box, Sphere, World
from tests.worlds import Float, landscape_frame

WIDTH, HEIGHT = 256, 128
ROOM = World(
    solids=(
        Box((0.5, -0.7, -1.4), (0.3, 0.5, 0.05), 0.6),
        Sphere((-0.4, 0.1, -1.6), 0.3),
        Box((0.3, 0.2, 1.5), (0.04, 1.0, 0.04)),
    )
)
COLORS = np.array([[0.6, 0.5, 0.4], [0.9, 0.2, 0.1], [0.1, 0.3, 0.5], [0.05, 0.05, 0.05]])
"""Of the room and of the solids."""

VIEWS = {
    "ahead": View(96, 64, fov_y_deg=40.0),
    "tilted": View(65, 47, yaw_deg=30.0, pitch_deg=-25.0, fov_y_deg=30.0),
    "seam": View(64, 48, yaw_deg=170.0, pitch_deg=5.0, fov_y_deg=30.0),
    "whole, fine": View(2 * WIDTH, 2 * HEIGHT, projection="equirect"),
}
views = pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)


def shown(device: ComputeDevice, panorama: Panorama, view: View, *, sharp: bool = True) -> Layer:
    return show(device, panorama, view, edges=sharp)


def color_of(d: Float) -> Float:
    """Return the colors (..., 3) in directions from the capture centre; each thing has one."""
    return COLORS[ROOM.first_hit(np.zeros(3), d)[2]]


def averaged(view: View, across: int = 8) -> Float:
    """Means of `color_of` over pixels."""
    x, y = np.meshgrid(np.arange(view.width), np.arange(view.height))
    steps = (np.arange(across) + 0.5) / across
    samples = [
        color_of(view.unproject(np.stack([x + u, y + v], axis=-1))) for u in steps for v in steps
    ]
    return np.asarray(np.mean(samples, axis=0))


@cache
def painted() -> Frame:
    """The room, of which texels show means."""
    color = averaged(View(WIDTH, HEIGHT, projection="equirect"))
    return replace(ROOM.frame(WIDTH, HEIGHT), color=color.astype(np.float32))


def textured() -> Frame:
    """The painted room with grain."""
    frame = painted()
    grain = np.random.default_rng(5).uniform(0.9, 1.1, frame.color.shape)
    return replace(frame, color=(frame.color * grain).astype(np.float32))


def ragged() -> Frame:
    """Rough surfaces and open sky, with gaps of all lengths, in random mixtures of two colors."""
    rng = np.random.default_rng(6)
    scraps, rough = gaussian_filter(rng.normal(size=(2, HEIGHT, WIDTH)), (0, 1, 1), mode="wrap")
    depth = np.where(scraps > 0.1, np.inf, 3.0 * np.exp(0.3 * rough))
    share = 0.7 * (scraps > 0.1) + 0.3 * rng.random((HEIGHT, WIDTH))
    color = COLORS[0] + share[..., None] * (COLORS[2] - COLORS[0])
    frame = ROOM.frame(WIDTH, HEIGHT)
    return replace(frame, depth=depth.astype(np.float32), color=color.astype(np.float32))


FRAMES = {"painted": painted, "ragged": ragged}


@pytest.mark.thorough
@pytest.mark.parametrize("make", FRAMES.values(), ids=FRAMES)
@pytest.mark.parametrize("name", ["ahead", "tilted", "seam"])
def test_the_twin_shows_the_same(
    device: ComputeDevice, name: str, make: Callable[[], Frame]
) -> None:
    """At an eighth of the pixels, as the twin is slow."""
    view, frame = VIEWS[name], make()
    panorama = loaded(device, frame)
    sharp, blurred = shown(device, panorama, view), shown(device, panorama, view, sharp=False)
    surface = device.read(panorama.surface)
    twin = edges.Panorama(frame.color, surface[..., 3].astype(int))
    wanted, normal = blurred.color.copy(), blurred.normal.copy()
    assert sharp.other is not None
    assert sharp.other_pixel is not None
    other, second = np.zeros(sharp.other.shape), np.full(sharp.depth.shape, -1)
    centres = View(WIDTH, HEIGHT, projection="equirect").directions()
    tried = np.random.default_rng(7).random(second.shape) < 0.125
    for y, x in np.argwhere(tried).tolist():
        pixel = twin.pixel(view, x, y)
        wanted[y, x] = pixel.color
        if pixel.texel is not None:
            g = surface[pixel.texel][:3].astype(np.float64)
            normal[y, x] = -g / max(np.linalg.norm(g), 1e-30)
        if pixel.beyond is not None:
            second[y, x] = y * view.width + x
            column, row = view.project(centres[pixel.beyond])
            if 0.0 <= column < view.width and 0.0 <= row < view.height:
                other[y, x] = pixel.other
                second[y, x] = int(row) * view.width + int(column)
    changed = np.abs(sharp.color - blurred.color).max(-1) > 1e-3
    assert changed.mean() > 0.03
    # At the border between two windows, and where two gaps are as near, rounding decides.
    off = np.abs(sharp.color - wanted).max(-1) > 2e-3
    assert off[tried].mean() < 0.01
    assert (np.abs(sharp.normal - normal).max(-1) > 1e-3)[tried].mean() < 0.01
    assert (other[..., 3] > 0.1)[tried].mean() > 0.003
    assert (np.abs(sharp.other - other).max(-1) > 2e-3)[tried].mean() < 0.01
    found = np.maximum(sharp.other_pixel, -1)  # UNEVEN is no edge
    assert (second != found)[tried].mean() < 0.01


@pytest.mark.thorough
@views
def test_edges_are_sharp(device: ComputeDevice, view: View) -> None:
    """They are nearer to the room than the resampled panorama, more so in finer views."""
    panorama = loaded(device, painted())
    sharp, blurred = shown(device, panorama, view), shown(device, panorama, view, sharp=False)
    truth = averaged(view)
    before = np.sqrt(np.mean((blurred.color - truth) ** 2))
    after = np.sqrt(np.mean((sharp.color - truth) ** 2))
    assert after < (0.7 if view == VIEWS["whole, fine"] else 0.5) * before
    # No pixel is darker or brighter than what is there.
    assert sharp.color.min() > 0.9 * COLORS.min()
    assert sharp.color.max() < 1.05 * COLORS.max()


@views
def test_surfaces_end_where_they_do(device: ComputeDevice, view: View) -> None:
    panorama = loaded(device, painted())
    sharp, blurred = shown(device, panorama, view), shown(device, panorama, view, sharp=False)
    depth = ROOM.first_hit(np.zeros(3), view.directions())[0]
    wrong = [float((np.abs(one.depth / depth - 1.0) > 0.05).mean()) for one in (sharp, blurred)]
    assert wrong[0] < 0.6 * wrong[1]


def test_far_from_gaps_nothing_changes(device: ComputeDevice) -> None:
    """Bit for bit."""
    frame, view = textured(), VIEWS["ahead"]
    panorama = loaded(device, frame)
    sharp, blurred = shown(device, panorama, view), shown(device, panorama, view, sharp=False)
    which = ROOM.first_hit(np.zeros(3), view.directions())[2]
    reach = 1 + int(2.5 * np.pi / HEIGHT * view.focal_px)
    window = 2 * reach + 1
    far = maximum_filter(which, window) == minimum_filter(which, window)
    far[:reach], far[-reach:], far[:, :reach], far[:, -reach:] = False, False, False, False
    assert far.mean() > 0.3
    np.testing.assert_array_equal(sharp.color[far], blurred.color[far])
    np.testing.assert_array_equal(sharp.depth[far], blurred.depth[far])


@pytest.mark.parametrize(
    "view",
    [View(WIDTH, HEIGHT, projection="equirect"), View(48, 32, fov_y_deg=120.0)],
    ids=["own size", "coarse"],
)
def test_views_that_are_not_finer_keep_their_bits(device: ComputeDevice, view: View) -> None:
    panorama = loaded(device, textured())
    sharp, blurred = shown(device, panorama, view), shown(device, panorama, view, sharp=False)
    for name in ("color", "normal", "depth", "id"):
        np.testing.assert_array_equal(getattr(sharp, name), getattr(blurred, name))


def test_a_horizon_is_an_edge(device: ComputeDevice) -> None:
    """A plain ends at the open sky: a pixel is one or the other."""
    frame, view = landscape_frame(WIDTH, HEIGHT), View(64, 48, fov_y_deg=10.0)
    layer = shown(device, loaded(device, frame), view)
    sky = layer.depth == 0.0
    rows = sky.mean(axis=1)
    assert set(np.unique(rows)) <= {0.0, 1.0}
    assert (np.diff(rows) <= 0.0).all()
    assert not layer.id[sky].any()
    assert not layer.normal[sky].any()


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**40])
def test_any_unit_of_light(device: ComputeDevice, factor: float) -> None:
    frame, view = painted(), VIEWS["tilted"]
    plain = shown(device, loaded(device, frame), view)
    color = (frame.color * factor).astype(np.float32)
    scaled = shown(device, loaded(device, replace(frame, color=color)), view)
    np.testing.assert_allclose(scaled.color, plain.color * factor, rtol=1e-4, atol=1e-6 * factor)
    np.testing.assert_allclose(scaled.depth, plain.depth)


@pytest.mark.parametrize("size", [(1, 1), (2, 1), (3, 2), (4, 2)])
def test_tiny_panoramas(device: ComputeDevice, size: tuple[int, int]) -> None:
    """Windows that hold a texel several times."""
    width, height = size
    frame = ROOM.frame(width, height)
    depth = np.random.default_rng(7).uniform(1.0, 5.0, (height, width)).astype(np.float32)
    color: NDArray[np.float32] = np.full((height, width, 3), 0.25, np.float32)
    frame = replace(frame, depth=depth, color=color)
    layer = shown(device, loaded(device, frame), View(64, 48, pitch_deg=-30.0))
    np.testing.assert_allclose(layer.color, 0.25, rtol=1e-5)
    assert np.isfinite(layer.depth).all()
