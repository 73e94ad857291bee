"""Promises that every method keeps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame
from iprt.settings.methods import methods
from tests.rendering import render
from tests.trace.closed_forms import BALL, box_of
from tests.trace.environments import CLAY, windowed
from tests.trace.estimators import furnace
from tests.variants import as_traced
from tests.worlds import ball

LOOK = View(48, 36, pitch_deg=-35.0)
FEW: dict[str, dict[str, int]] = {
    "vct": {"voxels": 32, "object_voxels": 32},
    "dvct": {"voxels": 32, "room_voxels": 32, "lights": 128},
    "dit": {"resolution": 32},
}
EVERY = pytest.mark.parametrize("method", sorted(methods()))


def shown(
    device: ComputeDevice, method: str, frame: Frame, objects: list[Instance]
) -> RenderedFrame:
    """Return a picture as traced."""
    own: dict[str, Any] = {method: FEW[method]} if method in FEW else {}
    return render(device, frame, objects, LOOK, as_traced(method, **own), 3)


@pytest.mark.thorough
@EVERY
def test_two_runs_agree_bit_for_bit(device: ComputeDevice, method: str) -> None:
    objects = [ball(*BALL, CLAY), box_of(Material("plastic", alpha=0.2))]
    first, second = (shown(device, method, windowed(), objects) for _ in range(2))
    np.testing.assert_array_equal(first.color, second.color)
    for name, image in first.aovs.items():
        np.testing.assert_array_equal(image, second.aovs[name], err_msg=name)
        assert np.isfinite(image).all(), name


@EVERY
def test_what_objects_do_not_reach_stays(device: ComputeDevice, method: str) -> None:
    """The plain keeps its bits above a buried object, and a world without light stays black."""
    frame = furnace("plain")
    dark = replace(frame, color=np.zeros_like(frame.color))
    buried, above = ball((0.2, -3.0, -0.9), 0.45, CLAY), ball(*BALL, CLAY)
    picture = shown(device, method, frame, [buried])
    np.testing.assert_array_equal(picture.color, picture.aovs["background"])
    np.testing.assert_array_equal(shown(device, method, dark, [above]).color, 0.0)


@pytest.mark.parametrize("method", sorted(methods().keys() - {"iprt", "vct", "dvct"}))
def test_even_light_shows_the_albedo(device: ComputeDevice, method: str) -> None:
    """To rounding, where neither voxels nor light that other objects change are in the way."""
    picture = shown(device, method, furnace("sphere"), [ball((0.1, -0.6, -1.0), 0.35, CLAY)])
    inside = picture.aovs["coverage"] == 1.0
    assert inside.sum() > 80
    wanted = np.broadcast_to(CLAY.albedo, (inside.sum(), 3))
    np.testing.assert_allclose(picture.color[inside], wanted, rtol=1e-5)
