"""The real layer of a view against a twin in numpy, an analytic room and its own symmetries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.compositing.real_layer import RealLayer
from iprt.device.compute import ComputeDevice
from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.frame import Frame
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from tests.compositing.layers import Layer, loaded, show
from tests.oracles.worlds import Box, World
from tests.worlds import Float, landscape_frame, panorama_in

WIDTH, HEIGHT = 256, 128
ROOM = World(solids=(Box((0.8, -0.9, -1.4), (0.3, 0.5, 0.25), 0.6),))
NOWHERE = -1e9

VIEWS = {
    "ahead": View(96, 64),
    "tilted": View(65, 47, yaw_deg=40.0, pitch_deg=-25.0, fov_y_deg=90.0),
    "seam": View(64, 48, yaw_deg=180.0, pitch_deg=5.0),
    "zenith": View(48, 64, yaw_deg=30.0, pitch_deg=90.0, fov_y_deg=80.0),
    "nadir": View(64, 48, yaw_deg=-70.0, pitch_deg=-90.0),
    "whole": View(WIDTH, HEIGHT, projection="equirect"),
    "whole, coarse": View(97, 49, projection="equirect"),
    "whole, fine": View(512, 256, projection="equirect"),
}
views = pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)


def resampled(
    device: ComputeDevice, frame: Frame, view: View, previous: View | None = None
) -> Layer:
    clipped = frame.clipped is not None
    return show(device, loaded(device, frame), view, previous, clipped=clipped)


def noisy_frame(world: World = ROOM) -> Frame:
    """The room in random colors."""
    color = np.random.default_rng(2).uniform(0.0, 4.0, (HEIGHT, WIDTH, 3))
    return replace(world.frame(WIDTH, HEIGHT), color=color.astype(np.float32))


def texel_of(d: Float) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Row and column of the panorama's texel in each direction; is it clear of the texel's edge."""
    column, row = np.moveaxis(equirect_pixel(d, WIDTH, HEIGHT), -1, 0)
    to_edge = np.minimum(abs(column - np.round(column)), abs(row - np.round(row)))
    return row.astype(int), column.astype(int) % WIDTH, to_edge > 1e-3


@views
def test_color_is_reconstructed(device: ComputeDevice, view: View) -> None:
    frame = noisy_frame()
    layer = resampled(device, frame, view)
    wanted = frame.color if view == VIEWS["whole"] else panorama_in(frame.color, view)
    # The kernel takes pixels for parallelograms in the panorama, which large ones are not.
    large = view == VIEWS["tilted"]
    np.testing.assert_allclose(layer.color, wanted, atol=0.015 if large else 4e-3)


def waves(cycles: float) -> Frame:
    """The room painted with waves along its rows, `cycles` to a texel, of 1 ± 0.2."""
    phase = 2.0 * np.pi * cycles * (np.arange(WIDTH) + 0.5)
    color = np.broadcast_to(1.0 + 0.2 * np.cos(phase)[None, :, None], (HEIGHT, WIDTH, 3))
    return replace(ROOM.frame(WIDTH, HEIGHT), color=color.astype(np.float32))


@pytest.mark.parametrize("cycles", [0.3, 1 / 3, 0.4])
def test_coarse_views_do_not_alias(device: ComputeDevice, cycles: float) -> None:
    """Waves finer than pixels, with a deviation of 0.14, become nearly their mean."""
    view = View(WIDTH // 3, HEIGHT // 3, projection="equirect")
    color = resampled(device, waves(cycles), view).color
    assert np.std(color) < 0.04
    np.testing.assert_allclose(color.mean(), 1.0, atol=2e-3)


def test_a_view_of_the_panoramas_size_is_the_panorama(device: ComputeDevice) -> None:
    """Texel for texel, bit for bit."""
    frame = noisy_frame()
    layer = resampled(device, frame, VIEWS["whole"])
    np.testing.assert_array_equal(layer.color, frame.color)
    np.testing.assert_allclose(layer.depth, frame.depth, rtol=1e-5)
    np.testing.assert_allclose(layer.normal, frame.normal, atol=1e-6)


@views
@pytest.mark.parametrize("share", [0.02, 1.0])
def test_what_was_clipped_is_shown_as_it_was_seen(
    device: ComputeDevice, view: View, share: float
) -> None:
    """Bit for bit the layer of the picture, in which no light is known."""
    seen = noisy_frame()
    inside = np.random.default_rng(3).random(seen.depth.shape) < share
    texel = np.flatnonzero(inside).astype(np.int32)
    light = np.where(inside[..., None], 10.0 * seen.color, seen.color).astype(np.float32)
    clipped = ClippedTexels(texel, seen.color.reshape(-1, 3)[texel])
    found = resampled(device, replace(seen, color=light, clipped=clipped), view)
    np.testing.assert_array_equal(found.color, resampled(device, seen, view).color)


@views
def test_surfaces_are_the_room(device: ComputeDevice, view: View) -> None:
    """Planes are exact, not just at texel centres; only texels with an edge in them are not."""
    layer = resampled(device, noisy_frame(), view)
    d = view.directions()
    depth, normal, which = ROOM.first_hit(np.zeros(3), d)
    row, column, _ = texel_of(d)
    centres = View(WIDTH, HEIGHT, projection="equirect").directions()
    _, centre_normal, centre_which = ROOM.first_hit(np.zeros(3), centres)
    shown = (centre_normal[row, column] == normal).all(-1) & (centre_which[row, column] == which)
    assert shown.mean() > 0.93
    # Beside a silhouette a plane may run out of the depths that its texel is known to hold.
    error = np.abs(layer.depth[shown] / depth[shown] - 1.0)
    assert (error < 1e-4).mean() > 0.999
    assert error.max() < 0.02
    np.testing.assert_allclose(layer.normal[shown], normal[shown], atol=1e-5)
    np.testing.assert_array_equal(layer.id, 1.0)
    # The position, which all passes compare, lies on the wall.
    position = d * layer.depth[..., None]
    walls = shown & (which == 0)
    bound = np.where(normal < 0.0, ROOM.high, ROOM.low)
    gap = np.abs((position - bound) * normal).sum(-1)
    assert gap[walls].max() < 1e-3
    np.testing.assert_allclose(np.linalg.norm(layer.normal, axis=-1), 1.0, atol=1e-5)
    assert (layer.depth > 0.5 * depth.min()).all()
    assert (layer.depth < 1.2 * depth.max()).all()


@views
def test_sky_and_openings_take_no_shadow(device: ComputeDevice, view: View) -> None:
    frame = landscape_frame(WIDTH, HEIGHT)
    opening = np.zeros((HEIGHT, WIDTH), bool)
    opening[66:126, ::7] = True
    opening[66:126, [127, 128, 129, 0, 1, 254, 255]] = True
    layer = resampled(device, replace(frame, opening=opening), view)
    row, column, clear = texel_of(view.directions())
    sky = np.isinf(frame.depth)[row, column]
    window = opening[row, column]
    np.testing.assert_array_equal(layer.depth[clear] == 0.0, sky[clear])
    np.testing.assert_array_equal(layer.id[clear] == 1.0, (~sky & ~window)[clear])
    assert not layer.id[clear & (sky | window)].any()
    assert not layer.normal[sky & clear].any()
    np.testing.assert_allclose(layer.normal[~sky & clear][:, 1], 1.0, atol=1e-3)
    assert view.pitch_deg == 90.0 or (window & clear).sum() > 20


TURNS: dict[str, dict[str, float]] = {
    "still": {},
    "to the right": {"yaw_deg": 3.7},
    "far to the left": {"yaw_deg": -31.0},
    "about face": {"yaw_deg": 180.0},
}
MOVES: dict[str, dict[str, float]] = {
    "up": {"pitch_deg": 2.2},
    "aside": {"yaw_deg": 20.0, "pitch_deg": -12.0},
    "zoom": {"fov_y_deg": -9.0},
}
CASES = [(name, move) for name in ("ahead", "tilted", "seam", "zenith") for move in TURNS | MOVES]
CASES += [(name, move) for name in ("whole", "whole, coarse") for move in TURNS]


@pytest.mark.parametrize(("name", "move"), CASES)
def test_motion_is_where_the_point_was(device: ComputeDevice, name: str, move: str) -> None:
    """The room's own points, projected into the view before."""
    view = VIEWS[name]
    changes = {key: getattr(view, key) + by for key, by in (TURNS | MOVES)[move].items()}
    previous = replace(view, **changes)
    motion = resampled(device, noisy_frame(), view, previous).motion
    d = view.directions()
    wanted = previous.project(d * ROOM.first_hit(np.zeros(3), d)[0][..., None])
    behind = np.isnan(wanted[..., 0])
    clear = np.asarray(np.abs((d @ previous.world_from_view)[..., 2]) > 1e-3)
    nowhere = motion.max(-1) == NOWHERE
    np.testing.assert_array_equal(np.asarray(nowhere)[clear], behind[clear])
    size = max(view.width, view.height)
    near = ~behind & np.asarray(np.abs(wanted) < 2 * size).all(-1)
    assert near.any() == (move != "about face" or name not in ("ahead", "tilted", "seam"))
    error = motion[near] - wanted[near]
    if view.projection == "equirect":
        error[:, 0] -= view.width * np.round(error[:, 0] / view.width)
    assert np.abs(error).max(initial=0.0) < 1e-3
    # What was not in the picture is not brought in by rounding.
    assert (np.abs(motion[~near & clear]) > 1.9 * size).any(-1).all()


def test_replaced_color_is_kept_bit_for_bit(device: ComputeDevice) -> None:
    layout = PlaneLayout(33, 17)
    layer = RealLayer(device, layout, name="real")
    picture = np.random.default_rng(1).random((17, 33, 3)).astype(np.float32)
    layer.replace_color(picture)
    np.testing.assert_array_equal(
        np.moveaxis(layout.interior(device.read(layer.color)), 0, -1), picture
    )
