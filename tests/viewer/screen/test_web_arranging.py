"""Several objects, snapshots and the search of settings, in the browser."""

from __future__ import annotations

import numpy as np

from tests.viewer.screen.browsing import Visitor, until
from tests.viewer.screen.web import PASSIVE, Place, at_rest, button, cube_middle

LARGE = (900, 900)


def names(place: Place) -> set[str]:
    return {state.name for state in place.engine.objects}


def undo_all(place: Place) -> None:
    while place.engine.can_undo:
        place.engine.undo()
    place.engine._shared.history.clear()


def test_objects_are_selected_with_control_and_copied(place: Place) -> None:
    visitor, browser = place.visit(LARGE)
    undo_all(place)
    at_rest(visitor, browser)
    width, height = visitor.canvas()
    x, y = visitor.project(cube_middle(place)) * (width, height)
    visitor.page.mouse.click(x, y)
    until(lambda: browser.selection.names == ("cube",), "it is not selected")
    browser.post("copy", browser.duplicate)
    until(lambda: names(place) == {"cube", "cube-2"}, "it is not copied")
    until(lambda: browser.selection.names == ("cube-2",), "the copy is not selected")
    at_rest(visitor, browser)
    visitor.page.keyboard.down("Control")
    visitor.page.mouse.click(x, y)
    visitor.page.keyboard.up("Control")
    until(lambda: browser.selection.names == ("cube-2", "cube"), "the other is not added")
    visitor.page.get_by_text("Arrange", exact=True).click()
    button(visitor, "Group").click()
    until(lambda: {s.group for s in place.engine.objects} == {"group"}, "there is no group")
    button(visitor, "Remove").click()
    until(lambda: names(place) == set(), "they are not removed")
    undo_all(place)
    until(lambda: names(place) == {"cube"}, "it does not come back")
    visitor.errors = [error for error in visitor.errors if PASSIVE not in error]


def test_a_snapshot_is_flipped(place: Place) -> None:
    visitor, browser = place.visit(LARGE)
    at_rest(visitor, browser)
    before = browser.displayed.pixels
    visitor.tab("Picture")
    button(visitor, "Snapshot").click()
    until(lambda: browser.viewport.snapshot is not None, "none is taken")
    place.engine.editor.remove(["cube"])
    until(lambda: names(place) == set(), "it is not removed")
    at_rest(visitor, browser)
    button(visitor, "Flip").click()
    until(lambda: np.array_equal(browser.displayed.pixels, before), "it is not shown")
    chart = visitor.page.locator(".distribution svg")
    until(lambda: chart.count() == 1, "there is no histogram")
    undo_all(place)


def test_settings_are_found_by_words(place: Place) -> None:
    visitor, browser = place.visit(LARGE)
    at_rest(visitor, browser)
    visitor.tab("Settings")
    visitor.input("Search settings").fill("caustic")
    found = visitor.page.get_by_text("caustic clamp")
    until(lambda: shown(visitor, "trace") and not shown(visitor, "atrous"), "all are shown")
    if not found.is_visible():
        visitor.page.get_by_text("trace", exact=True).click()
    found.wait_for(state="visible")
    assert not visitor.page.get_by_text("rays", exact=True).is_visible()


def shown(visitor: Visitor, group: str) -> bool:
    return bool(visitor.page.get_by_text(group, exact=True).is_visible())
