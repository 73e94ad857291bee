"""Light for blocks of pixels: what stays as it is, and how near the rest comes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from iprt.aovs import AOVS
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.renderer import RenderedFrame
from iprt.settings.model import Settings
from tests.frame.whole_frame import ROOM, still_life, two_frames
from tests.rendering import render
from tests.worlds import bright_walls, room_frame

pytestmark = pytest.mark.gl

VIEW = View(96, 72, pitch_deg=-35.0)
SMALL: dict[str, Any] = {"iprt": {"ratio_rows": 16}, "irradiance": {"rows": 32}, "fading": 0.0}
SHARP = "background", "normal", "depth", "albedo", "coverage", "motion"
"""Auxiliary pictures that have nothing to do with light."""


def settings(scale: int, **others: Any) -> Settings:
    return Settings.model_validate({**SMALL, "light_scale": scale, **others})


def pictures(
    device: ComputeDevice, view: View, *scales: int, frames: int = 2, **others: Any
) -> list[RenderedFrame]:
    frame, objects = two_frames()[0], still_life()
    return [
        render(device, frame, objects, view, settings(scale, **others), frames, AOVS)
        for scale in scales
    ]


def test_only_light_is_coarse(device: ComputeDevice) -> None:
    fine, coarse = pictures(device, VIEW, 1, 4)
    for name in SHARP:
        np.testing.assert_array_equal(coarse.aovs[name], fine.aovs[name], err_msg=name)
    assert (coarse.aovs["ratio"] != fine.aovs["ratio"]).any()


@pytest.mark.thorough
def test_light_comes_near_that_of_every_pixel(device: ComputeDevice) -> None:
    """Light at half the resolution loses little compared with the objects' influence."""
    frame, objects = room_frame(ROOM, 256, 128, bright_walls), still_life()
    fine, half, quarter = (
        render(device, frame, objects, VIEW, settings(scale), 32, ["background"])
        for scale in (1, 2, 4)
    )
    changed = np.sqrt(np.mean((fine.color - fine.aovs["background"]) ** 2))
    lost = [np.sqrt(np.mean((fine.color - coarse.color) ** 2)) for coarse in (half, quarter)]
    assert lost[0] < 0.12 * changed
    assert lost[1] < 0.25 * changed
    assert abs(fine.color.mean() - half.color.mean()) < 0.01 * fine.color.mean()


def test_coverage_takes_as_many_samples_as_asked_for(device: ComputeDevice) -> None:
    """Sixteenths, quarters, or all or nothing; of the same mean."""
    means = []
    for samples in (1, 2, 4):
        (picture,) = pictures(device, VIEW, 1, frames=1, coverage_samples=samples)
        coverage = picture.aovs["coverage"]
        steps = coverage * samples**2
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-5)
        assert (len(np.unique(coverage)) > 2) == (samples > 1)
        means.append(coverage.mean())
    np.testing.assert_allclose(means, means[-1], rtol=0.02)
