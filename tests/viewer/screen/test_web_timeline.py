"""Keyframes and views in the browser: folders of inputs, the path, and the camera that follows."""

from __future__ import annotations

import numpy as np

from iprt.scene.scene import Scene
from iprt.viewer.web.browser import Browser
from tests.viewer.screen.browsing import Visitor, until
from tests.viewer.screen.web import Place, at_rest, box, button, choose

SIZE = (520, 400)
PATH = "__viserMutable.nodeRefFromName['/path']"


def visit(place: Place) -> tuple[Visitor, Browser]:
    """Before the open folder of keyframes."""
    visitor, browser = place.visit(SIZE)
    at_rest(visitor, browser)
    visitor.page.get_by_text("Keyframes", exact=True).click()
    return visitor, browser


def reset(place: Place) -> None:
    while place.engine.can_undo:
        place.engine.undo()
    place.engine.seek(0)


def seek(place: Place, visitor: Visitor, browser: Browser, frame: int) -> None:
    place.engine.seek(frame)
    until(lambda: browser.displayed and browser.displayed.shown.frame == frame, "no such frame")
    at_rest(visitor, browser)


def test_keys_of_an_object(place: Place) -> None:
    """Set by the button and by recording, moved by number, and the path is drawn."""
    visitor, browser = visit(place)
    browser.post("select", lambda: setattr(browser, "selected", "cube"))
    button(visitor, "Set key").click()
    until(lambda: place.engine.world.edit_of("cube").keyframes, "no key is set")
    box(visitor, "Record").click()
    until(lambda: browser.selection.recording, "it does not record")
    seek(place, visitor, browser, 3)
    state = browser.state
    assert state is not None
    moved = state.to_world.copy()
    moved[0, 3] += 0.5
    browser.post("move", lambda: browser.selection.place(state, moved))
    visitor.page.wait_for_function(PATH)
    choose(visitor, "Key", "3, linear")
    visitor.input("At frame").fill("2")
    visitor.input("At frame").press("Enter")
    keys = [0.0, 1.0]  # two frames a second
    until(
        lambda: [k.time for k in place.engine.world.edits[0].keyframes or ()] == keys, "not moved"
    )
    seek(place, visitor, browser, 1)
    assert browser.state is not None
    np.testing.assert_allclose(browser.state.to_world[0, 3], moved[0, 3] - 0.25, atol=1e-6)
    button(visitor, "Delete keys").click()
    until(lambda: len(place.engine.world.edits[0].keyframes or ()) == 1, "not deleted")
    reset(place)
    visitor.page.wait_for_function(f"!{PATH}")


def turning(place: Place) -> tuple[Visitor, Browser]:
    """Before a view that keys turn to the right."""
    visitor, browser = visit(place)
    for frame, yaw in ((0, 0.0), (3, 30.0)):
        seek(place, visitor, browser, frame)
        visitor.drag((100.0, 300.0), (-yaw, 0.0))
        until(lambda yaw=yaw: (browser.viewport.name is None) == (yaw > 0.0), "not turned")
        at_rest(visitor, browser)
        button(visitor, "Set key").click()
        until(lambda: browser.viewport.name == "ahead", "the key is not set")
    return visitor, browser


def test_the_camera_follows_the_keys_of_a_view(place: Place) -> None:
    visitor, browser = turning(place)
    entry = place.engine.views["ahead"]
    assert entry.motion is not None
    for frame in (0, 2, 3):
        seek(place, visitor, browser, frame)
        wanted = entry.at(frame / 2.0).world_from_view @ (0.0, 0.0, -1.0)
        until(lambda w=wanted: np.abs(visitor.looks()[:3] - w).max() < 1e-3, "it looks elsewhere")
    browser.viewport.save()
    until(lambda: not place.engine.unsaved, "not saved")
    saved = Scene.open(place.engine.scene.root).views["ahead"]
    assert saved.at(1.0) == entry.at(1.0)
    reset(place)
    browser.viewport.save()
    until(lambda: not place.engine.unsaved, "not restored")


def test_a_view_that_plays_can_be_left(place: Place) -> None:
    """The camera follows the keys until its user turns it, and then stays."""
    visitor, browser = turning(place)
    seek(place, visitor, browser, 0)
    place.engine.set_loop(True)
    place.engine.play()
    around = browser._around._shown
    until(lambda: browser.viewport.view.yaw_deg > 2.0, "it does not follow")
    until(lambda: browser.viewport.frame == 0, "it does not begin again")
    assert browser.viewport.name == "ahead", "it is left by itself"
    assert browser._around._shown is around, "the video around is sent without need"
    visitor.drag((100.0, 300.0), (150.0, 0.0), steps=15)
    until(lambda: browser.viewport.name is None, "it is not left")
    place.engine.pause()
    place.engine.set_loop(False)
    assert at_rest(visitor, browser).yaw_deg < -2.0
    reset(place)
