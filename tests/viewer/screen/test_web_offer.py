"""The browser's question about unsaved edits that an earlier viewer left."""

from __future__ import annotations

from tests.viewer.orders import leave_edits
from tests.viewer.screen.browsing import until
from tests.viewer.screen.web import Place, at_rest, button


def test_edits_are_restored_or_discarded_by_any_browser(place: Place) -> None:
    """All browsers are asked, until one has answered."""
    engine = place.engine
    visitor, browser = place.visit()
    other, _ = place.visit()
    at_rest(visitor, browser)
    assert not button(visitor, "Restore").is_visible()
    leave_edits(engine.scene, "older", locked=True)
    leave_edits(engine.scene, "newer", removed=True)
    engine.autosaver.looked = False
    for page in (visitor, other):
        page.page.get_by_text("were found: cube.").wait_for()
    button(visitor, "Restore").click()
    until(lambda: engine.world.edit_of("cube").removed, "not restored")
    until(lambda: engine.autosaver.offer is not None, "the other is not offered")
    button(other, "Discard").click()
    until(lambda: not button(visitor, "Discard").is_visible(), "still asked")
    until(lambda: engine.autosaver.looked, "not looked")
    assert engine.autosaver.offer is None
    assert not engine.world.edit_of("cube").locked
    button(visitor, "Undo").click()
    until(lambda: engine.unsaved == (), "not undone")
