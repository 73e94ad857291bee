"""What mirror balls show: the room, other objects, and the shadows that these cast."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from tests.oracles.worlds import Sphere
from tests.rendering import render
from tests.trace.traced import (
    BLACK,
    FLOOR,
    MIRROR,
    ROOM,
    mirror_rays,
    settings,
)
from tests.worlds import Float, ball, bright_walls, ceiling_lamp, cuboid, room_frame

PANORAMA = View(256, 128, projection="equirect")
COARSE = {"irradiance": {"rows": 32}}
MIRROR_BALL = Sphere((0.2, -0.3, -1.4), 0.4)


def wall_light(o: Float, d: Float) -> tuple[Float, NDArray[np.bool_]]:
    """Return the walls' light along rays, and whether it is clear of the edges between them."""
    t, normal, _ = ROOM.first_hit(o, d)
    point = o + t[..., None] * d
    gaps = np.minimum(point - ROOM.low, np.asarray(ROOM.high) - point)
    return bright_walls(point, normal), np.sort(gaps, axis=-1)[..., 1] > 0.06


@pytest.mark.parametrize("view", [View(96, 72), PANORAMA], ids=lambda view: view.projection)
@pytest.mark.parametrize("method", ["iprt", "ibl"])
def test_mirror_ball_shows_the_room(device: ComputeDevice, method: str, view: View) -> None:
    """From the ball's surface with parallax; from the capture centre where all is far away."""
    frame = room_frame(ROOM, 256, 128, bright_walls)
    objects = [ball(MIRROR_BALL.centre, MIRROR_BALL.radius, MIRROR)]
    picture = render(device, frame, objects, view, settings(method=method))
    point, d, cosine = mirror_rays(view, MIRROR_BALL)
    parallax, clear = wall_light(point, d)
    distant, clear_far = wall_light(np.zeros_like(point), d)
    wanted, other = (parallax, distant) if method == "iprt" else (distant, parallax)
    inner = (picture.aovs["coverage"] == 1.0) & (cosine > 0.3) & clear & clear_far
    assert inner.sum() > 150
    wanted, other = wanted[inner] * MIRROR.albedo, other[inner] * MIRROR.albedo
    right = (np.abs(picture.color[inner] - wanted) < 0.03 * wanted.max(-1, keepdims=True)).all(-1)
    assert right.mean() > 0.95
    # The two would not be confused.
    assert (np.abs(wanted - other).max(-1) > 0.1).mean() > 0.2


@pytest.mark.parametrize(
    "centre", [(-0.55, -0.2, -0.9), (1.3, -0.2, -0.5)], ids=["on screen", "off screen"]
)
def test_mirror_ball_shows_other_objects(
    device: ComputeDevice, centre: tuple[float, float, float]
) -> None:
    """Mirror rays that truly meet a black ball are black, those that miss it are not."""
    view = View(144, 108)
    black = Sphere(centre, 0.3)
    objects = [ball(MIRROR_BALL.centre, MIRROR_BALL.radius, MIRROR), ball(centre, 0.3, BLACK)]
    frame = room_frame(ROOM, 256, 128, bright_walls)
    picture = render(device, frame, objects, view, settings())
    point, d, cosine = mirror_rays(view, MIRROR_BALL)
    normal = (point - MIRROR_BALL.centre) / MIRROR_BALL.radius

    def met(radius: float) -> NDArray[np.bool_]:
        enter, _, _, _ = Sphere(centre, radius).interval(point, d)
        return np.asarray(np.isfinite(enter) & (enter > 0.0))

    first = black.interval(np.zeros_like(d), view.directions())[0]
    is_mirror = ~(np.isfinite(first)) & (picture.aovs["coverage"] == 1.0) & (cosine > 0.3)
    is_mirror &= np.linalg.norm(normal, axis=-1) < 1.01
    inside, outside = is_mirror & met(0.24), is_mirror & ~met(0.36)
    assert inside.sum() > 15
    dark = picture.color.max(-1) < 0.01
    assert dark[inside].mean() > 0.95
    assert dark[outside].mean() < 0.01


def test_reflections_are_relit_when_asked(device: ComputeDevice) -> None:
    """A mirror ball shows the shadow of a box on the floor, as dark as the floor itself."""
    mirror = Sphere((0.45, FLOOR + 0.4, -1.7), 0.4)
    objects = [
        ball(mirror.centre, mirror.radius, MIRROR),
        cuboid((-0.35, FLOOR + 0.45, -1.5), (0.2, 0.2, 0.2), BLACK),
    ]
    frame = room_frame(ROOM, 256, 128, ceiling_lamp)
    view = View(128, 96, pitch_deg=-35.0)
    on, off = (
        render(device, frame, objects, view, settings(8, relit, **COARSE), 2)
        for relit in (True, False)
    )
    # The map of what is out of view has E_R refined in more places.
    np.testing.assert_allclose(on.aovs["ratio"], off.aovs["ratio"], atol=2e-2)
    point, d, cosine = mirror_rays(view, mirror)
    t, normal, _ = ROOM.first_hit(point, d)
    reflected = point + t[..., None] * d
    box_seen = np.linalg.norm(on.aovs["normal"] - (point - mirror.centre) / mirror.radius, axis=-1)
    floor = (
        (normal[..., 1] > 0.5) & (cosine > 0.3) & (on.aovs["coverage"] == 1.0) & (box_seen < 0.1)
    )
    # What was reflected is the box itself where it is black without relighting.
    floor &= off.aovs["specular"].min(-1) > 0.05
    column, row = np.moveaxis(view.project(reflected), -1, 0)
    floor &= (column > 1) & (column < 127) & (row > 1) & (row < 95)
    there = np.moveaxis(np.floor(view.project(reflected[floor])).astype(int), -1, 0)
    change = on.color[floor] / off.color[floor]
    assert (change < 0.6).sum() > 30
    # Up to a shift of two pixels, for rays start a little above the sphere.
    around = np.lib.stride_tricks.sliding_window_view(
        np.pad(on.aovs["ratio"], ((2, 2), (2, 2), (0, 0)), "edge"), (5, 5), (0, 1)
    )[there[1], there[0]]
    low, high = around.min((-2, -1)), around.max((-2, -1))
    assert ((change > low - 0.03) & (change < high + 0.03)).mean() > 0.95
    assert (high - low).mean() < 0.35
    # Walls out of view are as light as before.
    beyond = (on.aovs["coverage"] == 1.0) & (cosine > 0.3) & (view.project(reflected)[..., 1] < -2)
    assert beyond.sum() > 30
    np.testing.assert_allclose(on.color[beyond], off.color[beyond], rtol=0.06)


def test_reflections_are_relit_out_of_view(device: ComputeDevice) -> None:
    """A mirror ball above the view's lower edge shows the shadow below it."""
    mirror = Sphere((0.45, -0.1, -1.9), 0.4)
    objects = [
        ball(mirror.centre, mirror.radius, MIRROR),
        cuboid((-0.15, FLOOR + 0.3, -1.2), (0.25, 0.05, 0.25), BLACK),
    ]
    frame = room_frame(ROOM, 256, 128, ceiling_lamp)
    view = View(96, 72, pitch_deg=12.0)
    on, off = (
        render(device, frame, objects, view, settings(8, relit, **COARSE), 4)
        for relit in (True, False)
    )
    point, d, cosine = mirror_rays(view, mirror)
    t, normal, _ = ROOM.first_hit(point, d)
    reflected = point + t[..., None] * d
    floor = (normal[..., 1] > 0.5) & (cosine > 0.3) & (on.aovs["coverage"] == 1.0)
    floor &= off.aovs["specular"].min(-1) > 0.05
    down = View(96, 96, pitch_deg=-60.0, fov_y_deg=80.0)
    ratio = render(device, frame, objects, down, settings(8, False, **COARSE), 4).aovs["ratio"]
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = np.moveaxis(down.project(reflected), -1, 0)
    floor &= (column > 2) & (column < 94) & (row > 2) & (row < 94)
    with np.errstate(divide="ignore", invalid="ignore"):
        assert not (view.project(reflected[floor])[:, 1] < 72).any()
    assert floor.sum() > 60
    change = on.color[floor] / off.color[floor]
    there = ratio[row[floor].astype(int), column[floor].astype(int)]
    assert (there < 0.5).mean() > 0.02
    # Coarser than the view, but not far from it.
    difference = np.abs(change - there).mean()
    assert difference < 0.1
    assert difference < 0.5 * (1.0 - there).mean()
    assert np.corrcoef(change.ravel(), there.ravel())[0, 1] > 0.85
