"""The panels and what lies over the picture, as one who sits before the browser uses them."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.viewer.core import Core
from iprt.viewer.engine import Engine
from iprt.viewer.web.browser import Start
from iprt.viewer.web.host import Host
from tests.viewer.screen.browsing import DEADLINE_S, Visitor, until
from tests.viewer.screen.web import (
    PASSIVE,
    Place,
    at_rest,
    bar,
    box,
    button,
    choose,
    is_grey,
    screen,
)
from tests.viewer.turns import SETTINGS

LARGE = (900, 700)
"""Width and height of a browser's window in which all of a tab is in sight."""


def wait_for(visitor: Visitor, script: str) -> None:
    visitor.page.wait_for_function(script, timeout=1000 * DEADLINE_S)


def places(visitor: Visitor) -> list[dict[str, float]]:
    """Where controls of the open tab are."""
    found = [visitor.page.get_by_role("tab", name=name) for name in ("Scene", "Picture")]
    return [settled(item) for item in (*found, visitor.input("Show"))]


def settled(item: Any) -> dict[str, float]:
    """Where it is, once nothing slides any more."""
    boxes = [{}]

    def rests() -> bool:
        item.page.wait_for_timeout(100)
        boxes.append(item.bounding_box())
        return bool(boxes[-1] == boxes[-2])

    until(rests, "it does not rest")
    return dict(boxes[-1])


def test_controls_stay_where_they_are(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the status has to tell: nothing, a pixel's values, or three problems at once."""
    visitor, browser = place.visit(LARGE)
    at_rest(visitor, browser)
    visitor.tab("Picture")
    before = places(visitor)
    visitor.page.mouse.click(100, 500)
    wait_for(visitor, "document.querySelector('.pixel')")
    assert places(visitor) == before

    status = place.engine.status
    problem = "scene.toml: objects[0].mesh: a very long line of what is wrong. " * 8
    many = replace(status, problems=(problem,) * 3, notes=("vertex colors are not read",))
    monkeypatch.setattr(type(place.engine), "status", property(lambda _: many))
    wait_for(visitor, "document.querySelectorAll('.problem').length === 3")
    assert places(visitor) == before
    notes = visitor.page.locator(".note")
    notes.scroll_into_view_if_needed()
    assert notes.inner_text() == "vertex colors are not read"
    monkeypatch.undo()
    wait_for(visitor, "!document.querySelector('.problem')")


def test_what_is_given_up_in_motion_is_said_in_plain_words(place: Place) -> None:
    """With the details under the mouse; neither speed nor latency are told at rest."""
    visitor, browser = place.visit()
    view = at_rest(visitor, browser)
    wait_for(visitor, "!document.querySelector('.status .speed')")
    text = visitor.page.locator(".status .picture")
    until(lambda: text.inner_text() == f"{view.width} × {view.height}, lossless", "not sharp")
    browser.viewport.motion.target_fps = 1000.0  # more than any device has
    with turning(visitor):
        preview = visitor.page.get_by_text("Preview at")
        preview.wait_for(timeout=1000 * DEADLINE_S)
        words = preview.inner_text()
        told = preview.locator("..").get_attribute("title")
    assert words.endswith("% resolution")
    assert re.match(r"\d+ × \d+, ", told)
    assert words.removeprefix("Preview at ") in told
    assert "full quality as soon as nothing moves" in told
    assert "->" not in words
    at_rest(visitor, browser)
    wait_for(visitor, "!document.querySelector('.status .speed')")
    until(lambda: text.inner_text() == f"{view.width} × {view.height}, lossless", "not sharp")


@contextmanager
def turning(visitor: Visitor) -> Iterator[None]:
    """The view turns meanwhile, in the page."""
    visitor.page.evaluate(
        """() => { window.turning = setInterval(() => {
            __viserMutable.cameraControl.rotate(0.01, 0, false);
        }, 20); }"""
    )
    try:
        yield
    finally:
        visitor.page.evaluate("clearInterval(window.turning)")


def test_a_comparison_says_what_is_on_which_side(place: Place) -> None:
    """The bar is where the picture is divided, and divides it elsewhere when it is dragged."""
    visitor, browser = place.visit((760, 400))
    at_rest(visitor, browser)
    plain = browser.displayed.pixels
    # Pictures are decoded after they have arrived.
    until(lambda: np.array_equal(visitor.texture(), plain), "the pixels are others")
    visitor.tab("Picture")
    error = box(visitor, "Error map")
    assert is_grey(visitor, "Divide at")
    assert error.is_disabled(), "nothing is compared yet"
    choose(visitor, "Compare with", "Input")
    until(lambda: browser.displayed.sides is not None, "nothing is compared")
    until(lambda: error.is_enabled() and not is_grey(visitor, "Divide at"), "they stay grey")
    view = at_rest(visitor, browser)
    assert browser.displayed.sides == ("Picture", "Input")
    middle = 0.5 * view.width
    until(lambda: bar(visitor) == pytest.approx(middle, abs=1.5), "there is no bar")
    until(lambda: named(visitor, middle) == (True, True), "the sides are not named")

    visitor.drag((middle, 0.5 * view.height), (-0.2 * view.width, 30.0), steps=10)
    until(lambda: browser.viewport.lens.split == pytest.approx(0.3, abs=0.01), "it stays")
    turned = at_rest(visitor, browser)
    assert (turned.yaw_deg, turned.pitch_deg) == (view.yaw_deg, view.pitch_deg)
    until(lambda: bar(visitor) == pytest.approx(0.3 * view.width, abs=3.0), "the bar stays")
    column = round(browser.viewport.lens.split * view.width)
    until(
        lambda: np.array_equal(visitor.texture()[:, :column], plain[:, :column]),
        "the left side is another picture",
    )

    error.click()
    until(lambda: browser.displayed.sides is None, "it is divided still")
    until(lambda: bar(visitor) is None, "the bar stays")
    until(lambda: is_grey(visitor, "Divide at"), "what is not divided can be divided elsewhere")
    assert error.is_enabled()
    assert named(visitor, column) == (False, False)
    visitor.errors = [error for error in visitor.errors if PASSIVE not in error]


def named(visitor: Visitor, x: float) -> tuple[bool, bool]:
    """Whether there are words in bright boxes left and right of a column, at the upper end."""
    image = screen(visitor)[14:26].astype(int)
    left, right = (image[:, round(x) + at : round(x) + at + 20] for at in (-34, 15))
    bright = [(side.min(axis=2) > 200).mean() > 0.4 for side in (left, right)]
    return bright[0], bright[1]


def test_objects_are_hidden_and_shown(place: Place) -> None:
    """In this window alone."""
    (visitor, browser), (_, other) = place.visit(), place.visit()
    at_rest(visitor, browser)
    there = visitor.texture()
    cube = box(visitor, "cube")
    assert cube.is_checked()
    cube.click()
    until(lambda: browser.viewport.objects == (), "it is not hidden")
    at_rest(visitor, browser)
    until(lambda: not np.array_equal(visitor.texture(), there), "it is seen still")
    assert other.viewport.objects is None or "cube" in other.viewport.objects
    cube.click()
    until(lambda: browser.viewport.objects is None, "it is not shown")
    at_rest(visitor, browser)
    until(lambda: np.abs(visitor.texture().astype(int) - there).mean() < 3.0, "it is not seen")


def test_undo_and_redo(place: Place) -> None:
    """Grey where there is nothing to take back or to make again."""
    engine = place.engine
    while engine.can_undo:  # edits of other tests
        engine.undo()
    engine._shared.history.clear()
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    buttons = undo, redo, save = [button(visitor, name) for name in ("Undo", "Redo", "Save")]

    def lit(*expected: bool) -> None:
        until(lambda: [each.is_enabled() for each in buttons] == [*expected], str(expected))

    lit(False, False, False)
    engine.editor.remove(["cube"])
    lit(True, False, True)
    undo.click()
    lit(False, True, False)
    redo.click()
    lit(True, False, True)
    save.click()
    lit(True, False, False)
    undo.click()
    lit(False, True, True)
    save.click()
    until(lambda: not engine.unsaved, "the scene stays changed")


def test_playing(place: Place) -> None:
    """The switches do what they say, and the frame is counted."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    counter, playback = visitor.page.locator(".counter"), lambda: place.engine.playback
    until(lambda: counter.inner_text() == "0 of 3", "it is not counted")
    for name in ("Every frame", "Loop", "Play"):
        box(visitor, name).click()
    until(lambda: playback().playing and playback().loop, "it does not play in a loop")
    assert playback().mode == "every frame"
    until(lambda: browser.displayed.shown.frame == 3, "it does not go on")
    until(lambda: browser.displayed.shown.frame == 0, "it does not begin again")
    until(lambda: "fps" in counter.inner_text(), "the rate is not told")
    for name in ("Play", "Every frame", "Loop"):
        box(visitor, name).click()
    until(lambda: not playback().playing and not playback().loop, "it does not stop")
    assert playback().mode == "real time"
    place.engine.seek(0)


def test_materials_and_buffers_are_explained(place: Place) -> None:
    """Where the mouse rests on them; colors say in which numbers they are."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    choose(visitor, "Selected", "cube")
    until(lambda: browser.selected == "cube", "it is not selected")
    color = visitor.input("Color (sRGB)")
    until(lambda: color.is_visible(), "of which kind?")
    until(lambda: color.input_value() == "rgb(188, 149, 124)", color.input_value)
    assert "scene.toml stores linear values" in hint(visitor, "Color (sRGB)")
    color.fill("rgb(188, 149, 54)")
    color.press("Enter")
    blue = (54 / 255 + 0.055) / 1.055
    until(lambda: albedo(place)[2] == pytest.approx(blue**2.4, abs=1e-4), "it is not linear")
    place.engine.undo()
    assert "coat" in hint(visitor, "Material")
    visitor.tab("Picture")
    choose(visitor, "Show", "Depth")
    until(lambda: browser.viewport.lens.buffer == "depth", "it is not shown")
    until(lambda: "metres" in hint(visitor, "Show"), "it is not explained")
    shown = visitor.page.locator(".status .shows")
    until(lambda: shown.count() and "Depth" in shown.inner_text(), "the status does not name it")


def test_inputs_belong_to_what_is_selected(place: Place) -> None:
    """Materials and their maps to meshes, power to lights; none of them to nothing."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    maps, power = visitor.page.get_by_text("Maps", exact=True), visitor.input("Power")
    size = visitor.input("Size, m")

    def shown(*expected: bool) -> None:
        def seen() -> tuple[bool, ...]:
            return tuple(item.is_visible() for item in (maps, power, size))

        until(lambda: seen() == expected, lambda: str(seen()))

    shown(False, False, False)
    choose(visitor, "Selected", "cube")
    shown(True, False, True)
    button(visitor, "Add a light").click()
    shown(False, True, False)
    choose(visitor, "Light", "Spot")
    until(lambda: visitor.input("Inner angle").is_visible(), "it has no cone")
    power.fill("20")
    power.press("Enter")
    changed = {"kind": "spot", "power": 20.0}
    until(lambda: light_of(place).items() >= changed.items(), lambda: str(light_of(place)))
    while place.engine.can_undo:
        place.engine.undo()


def light_of(place: Place) -> dict[str, Any]:
    """Of the added light, as it is wanted."""
    return vars(place.engine.object_state("point").light)


def albedo(place: Place) -> tuple[float, float, float]:
    """Of the cube, as it is wanted."""
    return tuple(place.engine.object_state("cube").materials[0].albedo)


def hint(visitor: Visitor, label: str) -> str:
    """What an input says when the mouse rests on it."""
    tooltip = visitor.page.get_by_role("tooltip").first
    visitor.page.mouse.move(5, 5)
    tooltip.wait_for(state="hidden", timeout=1000 * DEADLINE_S)
    visitor.input(label).hover()
    tooltip.wait_for(timeout=1000 * DEADLINE_S)
    return str(tooltip.inner_text())


def test_the_video_is_seen_while_kernels_compile(
    place: Place, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And is told to be that, with how much is compiled."""
    free, compiles = threading.Event(), Core._compiles

    def slowly(core: Core, file: str) -> None:
        compiles(core, file)
        free.wait()

    monkeypatch.setattr(Core, "_compiles", slowly)
    scene = place.engine.scene
    start = Start(scene.views["ahead"].view)
    other = ComputeDevice(device.device)
    with (
        Engine(scene, lambda: other, SETTINGS) as engine,
        Host(engine, start, 0) as host,
    ):
        visitor = place.open(host.url)
        try:
            (browser,) = host.browsers
            visitor.page.get_by_text("the video; objects follow").wait_for()
            state = visitor.page.locator(".status .state").inner_text()
            assert re.fullmatch(r"compiling \d+ of \d+", state)
        finally:
            free.set()
        until(lambda: not browser.displayed.shown.plain, "objects do not follow")
        visitor.page.get_by_text("the video; objects follow").wait_for(state="detached")
        visitor.page.close()
