"""Seams and poles: a scene that is turned by half gives the same picture, by each method."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.model import Settings
from tests.oracles.worlds import World
from tests.rendering import render
from tests.worlds import Float, ball

CLAY, SHINY = Material(albedo=(0.8, 0.5, 0.2)), Material("plastic", (0.2, 0.4, 0.8), alpha=0.2)
BALLS = [
    ball((0.0, -0.2, 1.2), 0.3, SHINY),  # across the seam
    ball((0.05, -0.85, 0.05), 0.25, CLAY),  # around the nadir
    ball((0.05, 0.8, -0.05), 0.25, SHINY),  # around the zenith
]
TURN = np.diag([-1.0, 1.0, -1.0, 1.0])
VIEWS = {
    "seam": View(40, 32, yaw_deg=180.0),
    "nadir": View(40, 32, pitch_deg=-80.0),
    "zenith": View(40, 32, pitch_deg=80.0),
    "panorama": View(64, 32, projection="equirect"),
}
OWN: dict[str, dict[str, Any]] = {
    "vct": {"voxels": 48, "object_voxels": 48},
    "dvct": {"voxels": 48, "room_voxels": 48, "lights": 256},
    "dit": {"resolution": 64},
}


def blocks(picture: Float) -> Float:
    """Means of 4x4 pixels, in which noise is less."""
    height, width = picture.shape[:2]
    return np.asarray(picture.reshape(height // 4, 4, width // 4, 4, 3).mean((1, 3)))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("method", "view"),
    [("vct", "nadir"), ("dvct", "zenith"), ("dit", "seam"), *((name, "panorama") for name in OWN)],
)
def test_half_a_turn_changes_nothing(device: ComputeDevice, method: str, view: str) -> None:
    frame = World().frame(256, 128)
    d = View(256, 128, projection="equirect").directions()
    frame = replace(frame, color=(0.6 + 0.4 * np.sin(3.0 * d)).astype(np.float32))
    around = replace(frame, color=np.roll(frame.color, 128, 1), depth=np.roll(frame.depth, 128, 1))
    turned = [replace(one, to_world=TURN @ one.to_world) for one in BALLS]
    look = VIEWS[view]
    raw: dict[str, Any] = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}
    # One of many lights for each cone: their noise takes more cones to go.
    rays = {"trace": {"rays": 16, "object_rays": 8}} if method == "dvct" else {}
    settings = Settings.model_validate({"method": method, method: OWN[method], **raw, **rays})
    first = render(device, frame, BALLS, look, settings, 16, aovs=["coverage"])
    assert first.aovs["coverage"].mean() > 0.02
    if view == "panorama":
        second = np.roll(render(device, around, turned, look, settings, 16, aovs=[]).color, 32, 1)
    else:
        back = replace(look, yaw_deg=look.yaw_deg + 180.0)
        second = render(device, around, turned, back, settings, 16, aovs=[]).color
    apart = np.abs(blocks(first.color) - blocks(second)) / first.color.mean()
    # Two seeds are as far apart.
    assert apart.mean() < 0.01
    assert apart.max() < 0.05
