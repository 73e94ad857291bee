"""Pixels of objects send rays in proportion to the noise of their light."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.renderer import Renderer
from tests.frame.whole_frame import CLAY, METHODS, VIEW, chosen
from tests.oracles.worlds import World
from tests.worlds import ball, ceiling_lamp, room_frame

RAYS = 16


def bright_everywhere(points: NDArray[Any], normals: NDArray[Any]) -> NDArray[Any]:
    return np.ones(points.shape)


def rays_per_pixel(device: ComputeDevice, frame: Frame, fading: float) -> NDArray[Any]:
    """Return the rays of each pixel within the ball in the last of several frames."""
    settings = chosen(METHODS[0], fading=fading, trace={"object_rays": RAYS})
    things = [ball((0.3, -1.0, -1.4), 0.35, CLAY, subdivisions=3)]
    with Renderer(device, frame, things, VIEW, settings) as renderer:
        method: Any = renderer.method
        counts: list[NDArray[np.int64]] = []
        renderer.render(10)
        for _ in range(2):
            renderer.step()
            count = device.read(method.reflecting_pixels.tracer.samples)
            counts.append(renderer.layout.interior(count)[0].astype(np.int64))
        inside = renderer.render(0, ("coverage",)).aovs["coverage"] == 1.0
    return np.asarray(counts[1] - counts[0])[inside]


def test_rays_go_where_noise_is(device: ComputeDevice) -> None:
    """Even light has no noise. A lamp that few rays meet has much, above all where it is dim."""
    even = rays_per_pixel(device, room_frame(World(), 128, 64, bright_everywhere), 0.1)
    noisy = rays_per_pixel(device, room_frame(World(), 128, 64, ceiling_lamp), 0.1)
    assert np.median(even) == 1
    assert np.median(noisy) > 2 * np.median(even)
    assert noisy.max() > 2 * np.median(noisy)


@pytest.mark.parametrize("radiance", [bright_everywhere, ceiling_lamp])
def test_a_mean_of_all_frames_has_the_same_rays_everywhere(
    device: ComputeDevice, radiance: Any
) -> None:
    """Numbers that depend on earlier samples would bias it."""
    rays = rays_per_pixel(device, room_frame(World(), 128, 64, radiance), 0.0)
    assert np.median(rays) == RAYS / 4
    assert rays.min() == RAYS / 4


def test_black_surroundings(device: ComputeDevice) -> None:
    frame = room_frame(World(), 128, 64, lambda points, _: np.zeros(points.shape))
    assert np.median(rays_per_pixel(device, frame, 0.1)) == 1
