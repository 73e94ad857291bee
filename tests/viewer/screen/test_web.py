"""The viewer in a browser, for real: Chromium looks at it, drags, clicks, and vanishes."""

from __future__ import annotations

import gc
import re
import socket
import struct
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.output.display import developed
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.plain_video import PlainFrame
from iprt.viewer.web.browser import Browser
from tests.scene.files import CUBE
from tests.viewer.screen.browsing import Visitor, until
from tests.viewer.screen.web import (
    FRAMES,
    Place,
    at_rest,
    connected,
    cube_middle,
    cube_pivot,
    screen,
)
from tests.viewer.turns import SETTINGS

CLICK_S = 5.0
"""After so long, a user clicks again."""
PICTURE = re.compile(rb"\xff\xd8\xff|\x89PNG")


def test_at_rest_the_browser_has_the_renderers_bits(place: Place, device: ComputeDevice) -> None:
    visitor, browser = place.visit()
    view, scene = at_rest(visitor, browser), place.engine.scene
    assert (view.yaw_deg, view.pitch_deg, view.fov_y_deg) == (0.0, -30.0, 60.0)
    # What other tests moved leaves its noise: another seed begins anew.
    seeded = SETTINGS.model_copy(update={"seed": 5})
    change = place.engine.set_settings(seeded)
    until(lambda: browser.displayed.shown.number >= change, "the seed does not change")
    at_rest(visitor, browser)
    settings = seeded.model_copy(update={"fading": 0.0})
    mine = ComputeDevice(device.device)  # not that of an engine
    with Renderer(mine, scene.frame(0), scene.instances_of("ahead"), view, settings) as renderer:
        color = renderer.render(frames=FRAMES).color
    expected = developed(color, scene.exposure)
    assert np.array_equal(visitor.texture(), expected)
    # And on the screen; not in the panel's shadow.
    clear = np.s_[:, : view.width - 20]
    assert np.array_equal(screen(visitor)[clear], expected[clear])
    place.engine.set_settings(SETTINGS)


def test_looking_around(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    """A drag takes the scene along; gizmos, and the last picture until the next, go with it."""
    visitor, browser = place.visit()
    before = at_rest(visitor, browser)
    old = screen(visitor)
    monkeypatch.setattr(browser, "_show", lambda: False)  # no more pictures
    right, down = 30, 20
    visitor.drag((60, 120), (right, down))
    degrees = np.rad2deg(1.0 / before.focal_px)
    turned = (before.yaw_deg - right * degrees, before.pitch_deg + down * degrees)

    def looks() -> bool:
        view = browser.viewport.view
        return bool(np.allclose((view.yaw_deg, view.pitch_deg), turned, atol=0.1))

    until(looks, f"it does not turn to {turned}")
    warped = screen(visitor)
    around = browser.viewport.surroundings
    assert around is not None
    video = PlainFrame(around.pixels.astype(np.float32), 0, around.pose).seen(browser.viewport.view)
    # Left of the old picture; the panels cover the right.
    beside = np.s_[down + 10 : -10, 5 : right - 10]
    assert np.abs(warped[beside] - video[beside]).mean() < 5.0, "not the video beside it"
    assert video[beside].std() > 10.0
    monkeypatch.undo()
    view = at_rest(visitor, browser)
    inner = np.s_[down + 15 :, right + 15 : view.width - 20]
    new = screen(visitor)[inner].astype(float)
    stale, late = (np.abs(new - image[inner]).mean() for image in (old, warped))
    assert late < 0.25 * stale

    middle = cube_middle(place)
    x, y = visitor.project(middle)
    assert browser.viewport.picking.object_at(x, y) == "cube"
    assert (x, y) == pytest.approx(view.project(middle) / (view.width, view.height), abs=1e-3)
    visitor.page.mouse.move(60, 120)
    visitor.page.mouse.wheel(0, -200)
    until(lambda: browser.viewport.view.fov_y_deg < 55.0, "it does not zoom")
    assert at_rest(visitor, browser).fov_y_deg == pytest.approx(60.0 * 0.9**2)


def test_two_at_once(place: Place) -> None:
    """Views of their own; video, edits and settings are shared, and shown to both."""
    (one, mine), (two, yours) = place.visit(), place.visit()
    view = at_rest(two, yours)
    one.drag((60, 120), (40, 0))
    until(lambda: mine.viewport.view.yaw_deg < -1.0, "it does not turn")
    assert yours.viewport.view == view

    one.page.get_by_label("Play").click()
    until(lambda: place.engine.playback.since_s is not None, "it does not play")
    two.page.wait_for_function("document.querySelector('input[type=checkbox]:checked')")
    until(lambda: yours.displayed.shown.frame > 0, "the video stands")
    two.page.get_by_label("Play").click()
    until(lambda: place.engine.playback.since_s is None, "it does not pause")
    place.engine.seek(0)

    for visitor in (one, two):
        visitor.tab("Settings")
        visitor.page.get_by_text("atrous", exact=True).click()
    levels = one.input("levels")
    levels.fill("1")
    levels.press("Enter")
    until(lambda: place.engine.world.settings.atrous.levels == 1, "the setting does not turn")
    until(lambda: two.input("levels").input_value() == "1", "the other does not see it")
    place.engine.set_settings(SETTINGS)


def test_an_object_is_moved(place: Place) -> None:
    """Clicked, dragged by its gizmo, put elsewhere by a click; then all is taken back."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    width, height = visitor.canvas()
    x, y = visitor.project(cube_middle(place)) * (width, height)
    until(lambda: _selected(visitor, browser, (x, y)), "it is not selected")
    visitor.page.wait_for_function("__viserMutable.nodeRefFromName['/gizmo']")
    before, pivot = place.engine.objects[0].to_world, cube_pivot(place)
    x, y = visitor.project(pivot) * (width, height)
    # Along the world's +X, to the right: the gizmo's arrow is drawn there.
    along = visitor.project(pivot + np.array([0.1, 0.0, 0.0])) * (width, height) - (x, y)
    ahead = 50.0 * along / np.linalg.norm(along)
    until(lambda: _grabbed(visitor, browser, (x + ahead[0], y + ahead[1])), "nothing to grab")

    def moved() -> NDArray[np.float64]:
        return np.reshape(np.array(place.engine.world.edits[0].to_world), (4, 4))

    # The last of a drag's messages may still be on their way.
    until(lambda: moved()[0, 3] > before[0, 3] + 0.02, "it is not moved")
    np.testing.assert_allclose(moved()[1:3, 3], before[1:3, 3], atol=1e-6)
    np.testing.assert_allclose(moved()[:3, :3], before[:3, :3], atol=1e-6)

    visitor.page.keyboard.down("Shift")
    visitor.page.mouse.click(20, 0.85 * height)
    visitor.page.keyboard.up("Shift")
    view = browser.viewport.view
    until(lambda: abs(view.project(moved()[:3, 3])[0] - 20.0) < 12.0, "it is not put there")
    assert moved()[1, 3] == pytest.approx(before[1, 3], abs=1e-4), "it does not stand on the floor"
    until(lambda: _undone(place), "it is not undone")


def _undone(place: Place) -> bool:
    """A drag is more than one step where messages come slowly."""
    place.engine.undo()
    return place.engine.world.edits == ()


def _selected(visitor: Visitor, browser: Browser, at: tuple[float, float]) -> bool:
    """Whether a click takes; the server may be about to show another picture, and ignore it."""
    visitor.page.mouse.click(*at)
    end = time.monotonic() + CLICK_S
    while browser.selected != "cube" and time.monotonic() < end:
        time.sleep(0.02)
    return browser.selected == "cube"


def _grabbed(visitor: Visitor, browser: Browser, at: tuple[float, float]) -> bool:
    visitor.drag(at, (20, 0), steps=8)
    return bool(browser.engine.world.edits)


def test_the_page_corrects_what_the_server_takes_for_its_camera(place: Place) -> None:
    """As when the page sent its camera before it had its size, and the next message was lost."""
    visitor, browser = place.visit()
    view = at_rest(visitor, browser)
    stale = SimpleNamespace(wxyz=(0.0, 1.0, 0.0, 0.0), fov=1.3, image_width=600, image_height=240)
    browser._camera_came(stale)
    until(lambda: browser.viewport.view.width == 600, "the server does not follow")
    corrected = at_rest(visitor, browser)
    assert (corrected.width, corrected.height) == (view.width, view.height)
    assert corrected.yaw_deg == pytest.approx(view.yaw_deg, abs=1e-3)
    assert corrected.pitch_deg == pytest.approx(view.pitch_deg, abs=1e-3)


def test_reloading(place: Place) -> None:
    visitor, first = place.visit()
    at_rest(visitor, first)
    visitor.load()
    until(lambda: place.host.browsers and place.host.browsers[-1] is not first, "nobody came")
    until(lambda: len(place.host.browsers) == 1, "the old one stays")
    at_rest(visitor, place.host.browsers[0])


def test_those_that_vanish_leave_nothing(place: Place) -> None:
    """Twenty connections that are cut while pictures are on their way."""
    seen: list[weakref.ref[Browser]] = []
    for turn in range(20):
        connection = connected(place.host.url)
        (browser,) = until(lambda: place.host.browsers, "nobody came")
        seen.append(weakref.ref(browser))
        if turn % 7 == 0:
            # Compressed with other messages, a picture is not seen: then a silence ends it.
            connection.settimeout(1.0)
            received = b""
            with suppress(TimeoutError):
                while not PICTURE.search(received):
                    received = received[-4:] + connection.recv(65536)
        del browser
        # Without a word: the connection is reset.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.close()
        until(lambda: not place.host.browsers, "it is still there")
    until(lambda: not place.engine._core._sessions, "the engine renders for it")
    until(lambda: not _threads("iprt browser"), "a thread is left")

    def kept() -> list[weakref.ref[Browser]]:
        gc.collect()
        return [ref for ref in seen if ref() is not None]

    # The server's task of the last connection may still be about to end.
    until(lambda: not kept(), "a browser is kept")


def _threads(name: str) -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith(name)]


def test_meshes_are_uploaded_and_saved(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any names, all at once: the meshes lie in the scene's folder then. Comments stay."""
    visitor, browser = place.visit()
    at_rest(visitor, browser)
    engine, cube = place.engine, CUBE.encode()
    path: Path = engine.scene.root / "scene.toml"
    text = path.read_text()
    path.write_text("# mine\n" + text)
    # On one turn of the browser's thread: the newest does not take the others' place.
    names = ["box.obj", "box.obj", "../../up.obj", f"{'字' * 80}.OBJ", " .obj", "new\nline.obj"]
    files = [{"name": name, "mimeType": "", "buffer": cube} for name in names]
    button = visitor.page.locator("input[type=file]").first
    with held(browser):
        for number, file in enumerate(files, 1):
            button.set_input_files([file])
            until(lambda n=number: len(browser._posted) >= n, "it does not come")
    until(lambda: len(engine.objects) == 1 + len(files), "some are missing")
    added = [state.name for state in engine.objects[1:]]
    assert sorted(added) == sorted(["box", "box-2", "up", "字" * 60, "object", "new_line"])

    said: list[str] = []
    monkeypatch.setattr(browser, "say", lambda text, **_: said.append(text))
    for name, content in (("text.stl", b"solid"), ("empty.obj", b""), ("broken.ply", b"ply\n1")):
        button.set_input_files([{"name": name, "mimeType": "", "buffer": content}])
        news = partial(_news, engine, said, name)
        until(news, f"{name} is not reported")
    visitor.page.get_by_role("button", name="Save", exact=True).click()
    until(lambda: not engine.unsaved, "it is not saved")
    saved = path.read_text()
    assert saved.startswith("# mine\n")
    reopened = Scene.open(engine.scene.root)
    assert [entry.name for entry in reopened.objects] == ["cube", *added]
    for table in reopened.manifest.objects:
        assert (reopened.root / table.mesh).resolve().is_relative_to(reopened.root.resolve())
    path.write_text(text)
    until(lambda: len(engine.objects) == 1, "it is not read again")


def _news(engine: Engine, said: list[str], name: str) -> bool:
    return any(f"{name}: " in line for line in (*said, *engine.status.problems))


@contextmanager
def held(browser: Browser) -> Iterator[None]:
    """Its thread is busy meanwhile."""
    free = threading.Event()
    browser.post("hold", free.wait)
    until(lambda: "hold" not in browser._posted, "it does not begin")
    try:
        yield
    finally:
        free.set()
