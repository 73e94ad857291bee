"""Pixels of real surfaces with a long history send fewer rays, if the mean fades anyway."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.filter.signal_filter import SignalFilter
from iprt.footage.frame import Frame
from iprt.renderer import RenderedFrame, Renderer
from iprt.settings.model import Settings
from tests.frame.whole_frame import VIEW, require_only_noise, still_life, two_frames

pytestmark = pytest.mark.gl

FRAMES = 24


@pytest.fixture(scope="module")
def frame() -> Frame:
    return two_frames()[0]


def rays_while_turning(renderer: Renderer, frames: range) -> list[int]:
    """Real pixels that sent a ray in each frame."""
    counts = []
    for index in frames:
        renderer.look(replace(VIEW, yaw_deg=VIEW.yaw_deg + 0.2 * (index - FRAMES)))
        renderer.step()
        assert renderer.method is not None
        assert renderer.method.traced_count is not None
        counts.append(int(renderer.method.traced_count.get()[0]))
    return counts


@pytest.mark.thorough
def test_settled_pixels_wait_until_something_moves(device: ComputeDevice, frame: Frame) -> None:
    objects = still_life()
    with Renderer(device, frame, objects, VIEW, Settings(fading=0.1)) as renderer:
        counts = rays_while_turning(renderer, range(20))
        assert max(counts[12:]) < 0.6 * min(counts[2:7])
        moved = replace(objects[0], to_world=objects[0].to_world.copy())
        moved.to_world[0, 3] += 0.01
        renderer.move([moved, *objects[1:]])
        # Until the histories have followed, of which the last frames know nothing yet.
        assert min(rays_while_turning(renderer, range(20, 28))) > 0.9 * min(counts[2:7])


@pytest.mark.thorough
def test_waiting_costs_noise_alone(
    device: ComputeDevice, frame: Frame, monkeypatch: pytest.MonkeyPatch
) -> None:
    def turned(seed: int) -> RenderedFrame:
        with Renderer(device, frame, still_life(), VIEW, Settings(seed=seed)) as renderer:
            rays_while_turning(renderer, range(FRAMES))
            renderer.look(VIEW)
            return renderer.render(1, ["ratio"])

    waiting = turned(0)
    monkeypatch.setattr(SignalFilter, "known", lambda *_: None)
    dense, again = turned(0), turned(1)
    require_only_noise(waiting.aovs["ratio"], dense.aovs["ratio"], again.aovs["ratio"])
    assert np.abs(waiting.aovs["ratio"] - dense.aovs["ratio"]).max() > 0.0
