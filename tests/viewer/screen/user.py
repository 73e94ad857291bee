"""One who sits before the desktop viewer: acts by X's events, and looks at X's pixels."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imgui_bundle import imgui
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.desktop import app as app_module
from iprt.viewer.desktop.app import App
from iprt.viewer.desktop.style import BAD
from iprt.viewer.engine import Engine
from iprt.viewer.lens import Lens
from iprt.viewer.session import Shown
from iprt.viewer.viewport import Viewport
from tests.clips import write_clip
from tests.viewer.screen.x11 import Screen, xvfb
from tests.viewer.turns import SETTINGS
from tests.waiting import DEADLINE_S

SIZE = (256, 192)
"""Size of the picture."""
FRAMES = 3
"""To which it is refined."""
WIDGETS = (
    "slider_float slider_int drag_float button begin_tab_item collapsing_header color_edit3 "
    "begin_combo selectable checkbox input_text"
)
"""Widgets of imgui whose places are known."""
WORDS = {"text_unformatted": 0, "text_colored": 1, "separator_text": 0}
"""What draws words in imgui, and which argument these are."""


class User:
    """The viewer's user; steps of the viewer are taken while he waits."""

    def __init__(self, app: App, screen: Screen, folder: Path) -> None:
        self.app, self.screen, self.folder = app, screen, folder
        self.engine, self.ui = app._engine, app.ui
        self.places: dict[str, tuple[float, float, float, float]] = {}  # of widgets, by label
        self.mouse = (0.0, 0.0)  # where it was moved to last, in pixels of the picture
        self.seen: dict[str, int] = {}  # the frame that showed words and labels last

    def until(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + DEADLINE_S
        while not done():
            assert time.monotonic() < end, self.engine.status
            self.app.step()

    def wait(self, draws: int = 4) -> None:
        """Some drawn frames after input; none are drawn if there was none."""
        _ = self.app.window.position  # X's answer comes after the events sent before it
        before = imgui.get_frame_count()
        for _ in range(draws):
            self.app.step()
        while imgui.get_frame_count() < before + draws and self.app.window.wait(0.0):
            self.app.step()

    def at_rest(self) -> Shown:
        """The picture of what was asked for last, refined and drawn."""

        def done() -> bool:
            displayed, viewport = self.ui.displayed, self.ui.viewport
            return (
                displayed is not None
                and displayed.shown.refined
                and displayed.shown.request == viewport._wanted
                and not viewport._asked  # the same was asked for before, and others meanwhile
                and displayed.shown.frame == self.ui.frame
                and displayed.shown.number >= self.engine._shared._world_number
            )

        self.until(done)
        self.wait(2)
        assert self.ui.displayed is not None
        return self.ui.displayed.shown

    def point(self, x: float, y: float) -> tuple[float, float]:
        """On the screen, of a pixel of the picture."""
        left, top = self.app.window.position
        corner = self.app.picture_view.rectangle[:2]
        return left + corner[0] + x, top + corner[1] + y

    def picture(self) -> NDArray[np.uint8]:
        """What the screen shows of the picture."""
        left, top = (round(value) for value in self.point(0.0, 0.0))
        width, height = (round(value) for value in self.app.picture_view.rectangle[2:])
        return self.screen.picture(left, top, width, height)

    def move(self, x: float, y: float) -> None:
        self.mouse = x, y
        self.screen.move(*self.point(x, y))
        self.wait()

    def away(self) -> None:
        """The mouse off the picture, where nothing is beside it."""
        self.move(self.app.picture_view.rectangle[2] + 3.0, 3.0)  # the margin of the panels

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 4) -> None:
        self.move(*start)
        self.screen.button(1, down=True)
        self.wait(2)
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            self.screen.move(*self.point(*(np.array(start) * (1 - share) + np.array(end) * share)))
            self.wait(2)
        self.screen.button(1, down=False)
        self.wait()

    def drop(self, file: Path, x: float, y: float) -> None:
        """Let go of a file over a pixel, as GLFW tells it."""
        self.move(x, y)
        self.app.window._drop(None, [os.fsencode(file)])
        self.wait()

    def click(self, x: float, y: float) -> None:
        self.drag((x, y), (x, y), steps=1)

    def press(self, label: str, share: float = 0.5) -> None:
        """Click on a widget, at a share of its width; scroll to it first."""
        self.scroll_to(label)
        corner = self.app.picture_view.rectangle[:2]
        left, top, right, bottom = self.places[label]
        self.click(left + share * (right - left) - corner[0], 0.5 * (top + bottom) - corner[1])

    def scroll_to(self, label: str) -> None:
        """Until a widget of the panels is seen."""
        self.wait(2)
        height = self.app.window.size[1]
        while self.places[label][3] > height - 20.0:
            self.move(self.app.picture_view.rectangle[2] + 100.0, 100.0)
            self.screen.wheel(-1)
            self.wait(2)

    def key(self, name: str, *, control: bool = False) -> None:
        self.screen.key(name, control=control)
        self.wait()

    def problems(self) -> tuple[str, ...]:
        return self.engine.status.problems

    def reads(self, *words: str) -> bool:
        """The window shows all of these now, each as a text or as a part of one."""
        now = [text for text, frame in self.seen.items() if frame == imgui.get_frame_count()]
        return all(any(word in text for text in now) for word in words)

    def hover(self, label: str, share: float = 0.5) -> None:
        """The mouse over a widget, at a share of its width."""
        corner = self.app.picture_view.rectangle[:2]
        left, top, right, bottom = self.places[label]
        self.move(left + share * (right - left) - corner[0], 0.5 * (top + bottom) - corner[1])

    def reds(self) -> int:
        """Pixels of the picture in the color of problems."""
        difference = np.abs(self.picture().astype(int) - 255.0 * np.array(BAD[:3])).max(axis=2)
        return int((difference < 12).sum())

    def shows(self, name: str) -> bool:
        """An object is seen in the last picture."""
        displayed = self.ui.displayed
        geometry = None if displayed is None else displayed.shown.geometry
        return geometry is not None and name in geometry.names

    def cube(self) -> tuple[float, float]:
        """The pixel of the object's middle."""
        view = self.at_rest().request.view
        x, y = view.project(self.engine.objects[0].to_world[:3, 3])
        return float(x), float(y)

    def reset(self) -> None:
        """All as it was when the viewer was opened."""
        ui, engine = self.ui, self.engine
        ui.selected, ui.help, ui.readout = None, False, True
        ui.mode, ui.align, ui._notice = "move", False, None
        ui.selection.recording = False
        while engine.can_undo:
            engine.undo()
        engine.pause()
        engine.seek(0)
        engine.set_loop(False)
        engine.set_playback_mode("real time")
        engine.set_settings(SETTINGS)
        ui.viewport.lens = Lens()
        ui.viewport.go_to("ahead")
        assert self.app.picture_view.gesture is None


@contextmanager
def seated(device: ComputeDevice, folder: Path) -> Iterator[User]:
    """Before a viewer of a clip of four frames, on a screen of its own; its picture has `SIZE`."""
    scene = Scene.open(write_clip(folder / "clip", 4, size=SIZE))
    with pytest.MonkeyPatch.context() as patch, xvfb(1280, 800) as display:
        patch.setenv("DISPLAY", display)
        patch.delenv("WAYLAND_DISPLAY", raising=False)
        # The user's pictures, as desktops tell where they are.
        (folder / "user-dirs.dirs").write_text(f'XDG_PICTURES_DIR="{folder / "Pictures"}"\n')
        patch.setenv("XDG_CONFIG_HOME", str(folder))
        patch.delenv("XDG_PICTURES_DIR", raising=False)
        patch.setattr(app_module, "IDLE_S", 0.005)
        engine = Engine(scene, lambda: device, SETTINGS)
        view = scene.views["ahead"].view
        app = App(engine, Viewport(engine, view.resized(800, 600), frames=FRAMES))
        screen = Screen(display)
        user = User(app, screen, folder)
        _note(patch, user)
        # A picture of another shape would have margins.
        user.until(lambda: _fits(user))
        sides = (800 - app.picture_view.rectangle[2], 600 - app.picture_view.rectangle[3])
        app.window.size = round(SIZE[0] + sides[0]), round(SIZE[1] + sides[1])
        user.until(lambda: app.picture_view.rectangle[2:] == SIZE)
        screen.focus()
        try:
            yield user
        finally:
            app.close()
            engine.close()
            screen.close()


def _fits(user: User) -> bool:
    displayed = user.ui.displayed
    return displayed is not None and displayed.shown.request.view == user.ui.viewport.view


def _note(patch: pytest.MonkeyPatch, user: User) -> None:
    """Remember where widgets were drawn last, and in which frame each was seen as a whole."""
    for name in (*WIDGETS.split(), *WORDS):
        draw, place = getattr(imgui, name), WORDS.get(name, 0)

        def noting(*values: Any, draw: Any = draw, place: int = place) -> Any:
            result, label = draw(*values), values[place]
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            user.places[label] = low.x, low.y, high.x, high.y
            clip = imgui.get_window_draw_list()
            above, below = clip.get_clip_rect_min().y, clip.get_clip_rect_max().y
            if imgui.is_item_visible() and above <= low.y and high.y <= below:
                user.seen[label] = imgui.get_frame_count()
            return result

        patch.setattr(imgui, name, noting)
