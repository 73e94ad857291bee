"""The panel of light in the browser, and the arrow of the sun."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.scene.scene import Scene
from iprt.viewer.web.browser import Browser
from iprt.viewer.web.gizmo import SIZE_PX
from tests.viewer.screen.browsing import Visitor, until
from tests.viewer.screen.web import PASSIVE, Place, at_rest, box, button, choose

SIZE = (700, 400)
RING = 0.65
"""Radius of the gizmo's rings, relative to its size."""


def visit(place: Place) -> tuple[Visitor, Browser]:
    """Before the panel of light, with a sun that was set by hand."""
    visitor, browser = place.visit(SIZE)
    at_rest(visitor, browser)
    visitor.tab("Light")
    choose(visitor, "Sun", "Set by hand")
    until(lambda: place.engine.sun is not None, "there is no sun")
    return visitor, browser


def undo(place: Place) -> None:
    while place.engine.world.light.parts:
        place.engine.undo()


def test_the_sun_is_an_arrow_that_is_dragged(place: Place) -> None:
    """By a ring around its point, without turning the view."""
    visitor, browser = visit(place)
    box(visitor, "Show arrow").click()
    until(lambda: browser.selection.sun, "it is not selected")
    visitor.page.wait_for_function("__viserMutable.nodeRefFromName['/sun/arrow']")
    view, before = at_rest(visitor, browser), sun_of(place)
    arrow = browser.arrow(view)
    assert arrow is not None
    unit = SIZE_PX / view.focal_px * -(arrow.point @ view.world_from_view[:, 2])

    def on_ring(angle_deg: float) -> NDArray[np.float64]:
        """A pixel on the ring about the arrow's own X, from the sun."""
        angle = np.deg2rad(angle_deg)
        place = RING * unit * np.array([0.0, np.cos(angle), np.sin(angle)])
        return visitor.project(arrow.point + arrow.turn @ place) * visitor.canvas()

    def grabbed() -> bool:
        x, y = on_ring(45.0)
        visitor.drag((float(x), float(y)), tuple(on_ring(70.0) - (x, y)), steps=8)
        visitor.page.wait_for_timeout(200)
        return bool(np.abs(sun_of(place) - before).max() > 0.1)

    until(grabbed, "nothing to grab")
    after = at_rest(visitor, browser)
    assert (after.yaw_deg, after.pitch_deg) == pytest.approx((view.yaw_deg, view.pitch_deg))
    assert browser.selection.sun
    choose_object(visitor, browser)
    visitor.page.wait_for_function("!__viserMutable.nodeRefFromName['/sun/arrow']")
    undo(place)
    visitor.errors = [error for error in visitor.errors if PASSIVE not in error]


def sun_of(place: Place) -> NDArray[np.float64]:
    sun = place.engine.sun
    assert sun is not None
    return sun.direction


def choose_object(visitor: Visitor, browser: Browser) -> None:
    visitor.tab("Scene")
    choose(visitor, "Selected", "cube")
    until(lambda: browser.selected == "cube", "it is not selected")


def test_numbers_and_words_of_the_sun(place: Place) -> None:
    visitor, _ = visit(place)
    pitch = visitor.input("Pitch, °")
    pitch.fill("30")
    pitch.press("Enter")
    until(lambda: abs(sun_of(place)[1] - 0.5) < 1e-3, "it does not turn")
    told = visitor.page.locator(".told").first
    until(lambda: "30.0 degrees high" in told.inner_text(), told.inner_text)
    assert "declared" in told.inner_text()
    choose(visitor, "Sun", "None")
    until(lambda: place.engine.sun is None, "it still shines")
    until(lambda: box(visitor, "Show arrow").is_disabled(), "there is nothing to show")
    undo(place)


def test_switches_are_saved(place: Place) -> None:
    visitor, _ = visit(place)
    choose(visitor, "Sun", "None")
    for name in ("Find reflections", "Estimate the sky"):
        box(visitor, name).click()
    engine = place.engine
    until(lambda: engine.unsaved == ("gloss", "sun", "sky"), lambda: str(engine.unsaved))
    visitor.tab("Scene")
    button(visitor, "Save").click()
    until(lambda: not engine.unsaved, "it is not saved")
    video = Scene.open(engine.scene.root).manifest.video
    assert (video.gloss, video.sun, video.sky) == ("declared", "none", "none")
    undo(place)
    button(visitor, "Save").click()
    until(lambda: not engine.unsaved, "it is not saved back")
