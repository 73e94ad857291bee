"""Views with a truth, as one who edits the scene in a browser sees them, and opens it again."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import tomlkit

from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.state import REST_FRAMES
from tests.clips import write_clip
from tests.films import FEW
from tests.scene.files import CUBE, write_rgb
from tests.viewer.screen.browsing import Visitor, until

pytest.importorskip("viser", reason="pip install 'iprt[view]'")

from iprt.viewer.web.browser import Browser
from tests.viewer.screen.web import PASSIVE, Place, at_rest, bar, box, button, choose, serving

pytestmark = [
    pytest.mark.screen,
    pytest.mark.thorough,
    pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection"),
]
SIZE = (64, 48)


@pytest.fixture
def viewer(device: ComputeDevice, tmp_path: Path) -> Iterator[Place]:
    """A viewer of a scene whose only view has a truth."""
    folder = write_clip(tmp_path / "clip", 1, size=SIZE)
    manifest = folder / "scene.toml"
    manifest.write_text(manifest.read_text() + 'objects = ["cube"]\ntruth = "truth.exr"\n')
    write_rgb(folder / "truth.exr", np.full((SIZE[1], SIZE[0], 3), 0.5, np.float32))
    with serving(device, folder) as place:
        yield place


@contextmanager
def opened_again(place: Place, device: ComputeDevice) -> Iterator[Visitor]:
    """A page of `iprt view --web`, of the scene as it was saved."""
    few = place.engine.scene.root.parent / "few.toml"
    few.write_text(tomlkit.dumps(FEW))
    command = [sys.executable, "-m", "iprt", "view", str(place.engine.scene.root)]
    command += ["--web", "--port", "0", "--device", device.device.name, "--settings", str(few)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        try:
            assert running.stdout is not None
            visitor = place.open(running.stdout.readline().split()[1])
            yield visitor
            visitor.page.close()
            assert (visitor.errors, visitor.elsewhere) == ([], [])
        finally:
            running.send_signal(signal.SIGINT)


def told(visitor: Visitor, kind: str) -> str:
    """Lines of the status."""
    return " ".join(visitor.page.locator(f".status .{kind}").all_inner_texts())


def status(visitor: Visitor) -> list[str]:
    """All lines of it."""
    lines: list[str] = visitor.page.locator(".status").all_inner_texts()
    return lines


def rests(visitor: Visitor) -> bool:
    """The page says that it has the whole picture."""
    refined = told(visitor, "frames").startswith(f"{REST_FRAMES} of {REST_FRAMES}")
    return refined and "lossless" in told(visitor, "picture")


def test_what_was_added_is_seen_when_the_scene_is_opened_again(
    place: Place, device: ComputeDevice
) -> None:
    """Though the view in which it was added does not list it, because that has a truth."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    before = visitor.texture()
    file = {"name": "box.obj", "mimeType": "", "buffer": CUBE.encode()}
    visitor.page.locator("input[type=file]").first.set_input_files([file])
    until(lambda: "box" in names(browser), "it is not seen")
    at_rest(visitor, browser)
    seen = visitor.texture()
    there = np.abs(seen.astype(int) - before).max(axis=2) > 40
    assert there.mean() > 0.003
    button(visitor, "Save").click()
    until(lambda: not place.engine.unsaved, "it is not saved")
    assert Scene.open(place.engine.scene.root).views["ahead"].objects == ("cube",)

    with opened_again(place, device) as other:
        until(lambda: rests(other), lambda: f"it does not come to rest: {status(other)}")
        assert other.input("View").input_value() == "saved"
        assert box(other, "box").is_checked()
        again = other.texture().astype(int)
        assert again.shape == seen.shape
        added, missing = (np.abs(again - image).max(axis=2) for image in (seen, before))
        assert (added < missing)[there].mean() > 0.9


def test_a_truth_of_objects_that_were_moved_is_warned_of(
    place: Place, device: ComputeDevice
) -> None:
    """And not scored: until that is undone, or also later, if it is saved."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    compare(visitor)
    until(lambda: "SSIM" in told(visitor, "shows"), "it is not scored")
    assert told(visitor, "warning") == ""
    visitor.tab("Scene")
    choose(visitor, "Selected", "cube")
    until(lambda: browser.selected == "cube", "it is not selected")
    place_x = visitor.input("Position")
    place_x.fill("0.3")
    place_x.press("Enter")
    until(lambda: "objects have been edited since" in told(visitor, "warning"), "no warning")
    until(lambda: "SSIM" not in told(visitor, "shows"), "it is scored")
    assert place.engine.objects[0].to_world[0, 3] == pytest.approx(0.3)

    button(visitor, "Undo").click()
    until(lambda: told(visitor, "warning") == "", "the warning stays")
    until(lambda: "SSIM" in told(visitor, "shows"), "it is not scored again")
    button(visitor, "Redo").click()
    until(lambda: told(visitor, "warning"), "no warning")
    button(visitor, "Save").click()
    until(lambda: "remove truth_outdated" in told(visitor, "warning"), "it is not told why")

    with opened_again(place, device) as other:
        compare(other)
        until(lambda: "remove truth_outdated" in told(other, "warning"), "no warning")
        until(lambda: rests(other), "it does not come to rest")
        assert "Truth" in told(other, "shows")
        assert "SSIM" not in told(other, "shows")


def test_places_in_a_picture_of_another_shape_than_the_window(place: Place) -> None:
    """Truths have shapes of their own; what is clicked and dragged is what is at the mouse."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    compare(visitor)
    until(lambda: "SSIM" in told(visitor, "shows"), "it is not scored")
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


def names(browser: Browser) -> tuple[str, ...]:
    """Names of the objects in the picture, once it rests."""
    assert browser.displayed is not None
    geometry = browser.displayed.shown.geometry
    return () if geometry is None else geometry.names


def compare(visitor: Visitor) -> None:
    visitor.tab("Picture")
    choose(visitor, "Compare with", "Truth")
