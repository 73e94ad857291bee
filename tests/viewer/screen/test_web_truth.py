"""A view with a truth, in a browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from tests.clips import write_clip
from tests.scene.files import write_rgb
from tests.viewer.screen.browsing import until
from tests.viewer.screen.web import PASSIVE, Place, at_rest, bar, choose, serving


@pytest.fixture
def viewer(device: ComputeDevice, tmp_path: Path) -> Iterator[Place]:
    """A viewer of a scene whose only view has a truth."""
    folder = write_clip(tmp_path / "clip", 1, size=(64, 48))
    manifest = folder / "scene.toml"
    manifest.write_text(manifest.read_text() + 'objects = ["cube"]\ntruth = "truth.exr"\n')
    write_rgb(folder / "truth.exr", np.full((48, 64, 3), 0.5, np.float32))
    with serving(device, folder) as place:
        yield place


def test_places_in_a_picture_of_another_shape_than_the_window(place: Place) -> None:
    """Truths have shapes of their own; what is clicked and dragged is what is at the mouse."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    assert browser.viewport.truth_problem is None, browser.viewport.truth_problem
    visitor.tab("Picture")
    choose(visitor, "Compare with", "Truth")
    shows = visitor.page.locator(".status .shows")
    until(lambda: "SSIM" in " ".join(shows.all_inner_texts()), shows.all_inner_texts)
    width, height = visitor.canvas()
    shown = browser.displayed.shown.request.view
    assert abs(shown.width / shown.height - width / height) > 0.2
    visitor.drag((0.5 * width, 0.9 * height), (-0.2 * width, 0.0), steps=10)
    at_mouse = pytest.approx(0.3 * width, abs=3.0)
    until(lambda: bar(visitor) == at_mouse, lambda: f"the bar is at {bar(visitor)}")
    # On the cube's front, close to its right edge.
    x, y = visitor.project(np.array([0.38, -1.0, -1.3])) * (width, height)
    visitor.page.mouse.click(x, y)
    until(lambda: browser.selected == "cube", "it is not selected")
    visitor.errors = [error for error in visitor.errors if PASSIVE not in error]
