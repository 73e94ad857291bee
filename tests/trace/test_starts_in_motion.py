"""Rays of metals start at the centres of pixels while anything moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.renderer import Renderer
from tests.frame.whole_frame import METHODS, SILVER, VIEW, chosen
from tests.oracles.worlds import World
from tests.worlds import ball, ceiling_lamp, room_frame


def picture(device: ComputeDevice, seed: int, turn_deg: float) -> NDArray[np.float32]:
    """Return the pixels of a mirror ball in the second frame of a view that turns, on their own."""
    settings = chosen(METHODS[0], seed=seed, fading=1.0, atrous={"levels": 0})
    frame = room_frame(World(), 128, 64, ceiling_lamp)
    things = [ball((0.3, -1.0, -1.4), 0.35, SILVER, subdivisions=3)]
    with Renderer(device, frame, things, VIEW, settings) as renderer:
        renderer.render(1)
        renderer.look(replace(VIEW, yaw_deg=VIEW.yaw_deg + turn_deg))
        shown = renderer.render(1, ("coverage",))
    return shown.color[shown.aovs["coverage"] == 1.0]


def test_a_mirror_has_hardly_any_noise_in_motion(device: ComputeDevice) -> None:
    """What is left is the noise of shadows that it shows."""

    def noise(turn_deg: float) -> float:
        one, other = (picture(device, seed, turn_deg) for seed in (1, 2))
        return float(np.percentile(np.abs(one - other) / (one + other + 1e-6), 75))

    assert noise(1.0) < 0.1 * noise(0.0)
