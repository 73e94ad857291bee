"""Trails of moving things, inserted and real: their strength and duration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from tests.frame.whole_frame import CLAY, METHODS, chosen, rms
from tests.oracles.worlds import Sphere, World
from tests.worlds import Float, ball, bright_walls, ceiling_lamp, room_frame

pytestmark = [pytest.mark.gl, pytest.mark.thorough]

VIEW = View(64, 48, yaw_deg=5.0, pitch_deg=-35.0)
TRAIL = 8
"""Frames after which no trail may be visible."""
SURE: dict[str, Any] = {"fading": 0.0, "seed": 5, "trace": {"rays": 32, "object_rays": 1}}


def inserted(x: float = 0.2) -> Instance:
    return ball((x, -1.1, -1.4), 0.25, CLAY, subdivisions=3)


def shown(renderer: Renderer) -> tuple[Float, Float]:
    """(H, W) luminance of the ratio, and coverage."""
    aovs = renderer.render(0, ("ratio", "coverage")).aovs
    return aovs["ratio"].mean(-1, dtype=np.float64), aovs["coverage"].astype(np.float64)


def truths(
    device: ComputeDevice, scenes: list[tuple[Frame, Instance]]
) -> list[tuple[Float, Float]]:
    """Return the converged pictures of scenes at rest."""
    found = []
    for frame, thing in scenes:
        with Renderer(device, frame, [thing], VIEW, chosen(METHODS[0], **SURE)) as renderer:
            renderer.render(2)
            found.append(shown(renderer))
    return found


def left_behind(found: Float, truth: list[tuple[Float, Float]], age: int) -> float:
    """Share of a shadow that is still seen `age` frames after it has left."""
    (now, cover), (then, covered) = truth[-1], truth[-1 - age]
    gone = (cover == 0.0) & (covered == 0.0) & (now > 0.96) & (then < 0.85)
    for later, _ in truth[len(truth) - age :]:
        gone &= later > then + 0.1
    if gone.sum() < 12:
        return 0.0
    return float((now - found)[gone].mean() / (now - then)[gone].mean())


def test_shadows_of_objects_leave_no_trail(device: ComputeDevice) -> None:
    """An object slides over the floor, a fifth of its width per frame, after a long rest."""
    frame = room_frame(World(), 256, 128, ceiling_lamp)
    places = [inserted(-0.5 + 0.1 * i) for i in range(TRAIL + 3)]
    truth = truths(device, [(frame, thing) for thing in places])
    with Renderer(device, frame, places[:1], VIEW, chosen(METHODS[0])) as renderer:
        renderer.render(12)
        for thing in places[1:]:
            renderer.move([thing])
            renderer.step()
        found, _ = shown(renderer)
    trail = [left_behind(found, truth, age) for age in range(1, len(truth))]
    dark = truth[0][0] < 0.85
    assert dark.sum() > 40
    assert max(trail[TRAIL - 1 :]) < 0.06
    assert max(trail[3:]) < 0.3


def rolling(x: float) -> Frame:
    """A room in which a real ball lies, in a shadow of its own."""
    there = World(solids=(Sphere((x, -1.1, -1.0), 0.3),))

    def light(points: Float, normals: Float) -> Float:
        beside = np.hypot(points[..., 0] - x, points[..., 2] + 1.0) < 0.45
        floor = (normals[..., 1] > 0.9) & (points[..., 1] < -1.35)
        return bright_walls(points, normals) * np.where(beside & floor, 0.5, 1.0)[..., None]

    return room_frame(there, 256, 128, light)


def test_what_a_real_thing_uncovers_is_as_new(device: ComputeDevice) -> None:
    """A ball of the room rolls between the camera and the object; behind it, all is true at once,
    and settled eight frames later.
    """
    video = [rolling(-0.9 + 0.12 * i) for i in range(12)]
    thing = inserted(0.1)
    (truth,) = truths(device, [(video[-1], thing)])
    depths = [frame.depth for frame in video]
    with Renderer(device, video[-1], [thing], VIEW, chosen(METHODS[0])) as renderer:
        renderer.step()
        fresh, _ = shown(renderer)
    with Renderer(device, video[0], [thing], VIEW, chosen(METHODS[0])) as renderer:
        renderer.render(4)
        for frame in video[1:]:
            renderer.load(frame)
            renderer.step()
        found, _ = shown(renderer)
        history = renderer.layout.interior(
            device.read(renderer.method.real_pixels.accumulated.certainty)
        )[1]
    real = truth[1] == 0.0
    assert rms((found - truth[0])[real]) < 1.2 * rms((fresh - truth[0])[real])
    uncovered = seen(depths[-1]) > seen(depths[-4]) * 1.05
    # Edges lie between texels, up to one from where `seen` has them.
    uncovered = binary_erosion(uncovered & real, iterations=2)
    assert uncovered.sum() > 60
    # Three frames are all that is remembered there, and none of the ball's.
    assert history[uncovered].max() < 3.1
    assert np.median(history[real & ~uncovered]) > 5.0
    assert rms((found - truth[0])[uncovered]) < 1.2 * rms((fresh - truth[0])[uncovered])


def seen(panorama: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) nearest texels of an equirect picture in the view."""
    height, width = panorama.shape
    column, row = np.moveaxis(equirect_pixel(VIEW.directions(), width, height).astype(int), -1, 0)
    return panorama[row, column]
