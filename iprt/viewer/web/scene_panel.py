"""Which view, and which frame of the video."""

from __future__ import annotations

from html import escape
from typing import Any

from iprt.viewer.labels import PARTS, PLAYBACK, TURNED
from iprt.viewer.state import PlaybackMode
from iprt.viewer.web.binding import Binding, on_trigger, show
from iprt.viewer.web.browser_api import BrowserApi

EVERY: PlaybackMode = "every frame"
REAL_TIME: PlaybackMode = "real time"


class ScenePanel:
    """Views and playback. The window's thread uses it."""

    def __init__(self, browser: BrowserApi) -> None:
        self._browser = browser
        gui, scene = browser.client.gui, browser.engine.scene
        self._bindings: list[Binding] = []
        self._names = tuple(scene.views)
        self._views = gui.add_dropdown(
            PARTS["view"].name, (TURNED, *self._names), hint=PARTS["view"].about
        )
        self._bind(self._views, lambda: browser.viewport.name or TURNED, self._go_to)
        self._counter: Any = None
        frames = scene.frame_indices
        if len(frames) > 1:
            with gui.add_folder("Video"):
                self._add_playback(frames)

    def _bind(self, handle: Any, read: Any, write: Any) -> None:
        browser = self._browser
        self._bindings.append(Binding(handle, read, write, browser.post, browser.tell))

    def _add_playback(self, frames: range) -> None:
        browser, gui, engine = self._browser, self._browser.client.gui, self._browser.engine
        play, loop, every = PARTS["play"], PARTS["loop"], PLAYBACK[EVERY]
        playing = gui.add_checkbox(play.name, False, hint=f"{play.about} Key: space.")
        self._bind(
            playing,
            lambda: engine.playing,
            lambda on: engine.play() if on else engine.pause(),
        )
        self._bind(
            gui.add_checkbox(loop.name, False, hint=loop.about),
            lambda: engine.loop,
            engine.set_loop,
        )
        self._bind(
            gui.add_checkbox(
                every.name, False, hint=f"{every.about} Otherwise: {PLAYBACK[REAL_TIME].about}"
            ),
            lambda: engine.playback_mode == EVERY,
            lambda on: engine.set_playback_mode(EVERY if on else REAL_TIME),
        )
        slider = gui.add_slider(
            "Frame", frames[0], frames[-1], 1, frames[0], hint="As scene.toml counts"
        )
        self._bind(slider, self._frame, lambda frame: engine.seek(int(frame)))
        self._counter = gui.add_html("")
        on_trigger(gui.add_command("Play or pause", hotkey="space"), browser.post, self._toggle)

    def _toggle(self) -> None:
        engine = self._browser.engine
        (engine.pause if engine.playing else engine.play)()

    def _frame(self) -> int:
        """That is asked for, or in a video that plays, the one that is seen."""
        engine, displayed = self._browser.engine, self._browser.displayed
        if engine.playing and displayed is not None:
            return displayed.shown.frame
        return engine.world.playback.frame

    def _go_to(self, name: str) -> None:
        if name in self._browser.engine.scene.views:
            self._browser.go_to(name)

    def sync(self) -> None:
        names = tuple(self._browser.engine.scene.views)
        if names != self._names:
            self._names = names
            self._views.options = (TURNED, *names)
        if self._counter is not None:
            counter = self._browser.viewport.counter
            show(self._counter, "content", _counted("" if counter is None else counter.text))
        for binding in self._bindings:
            binding.sync()


def _counted(text: str) -> str:
    """Beside the column of labels; as high when there is nothing to tell."""
    style = "font-size:.8em;height:1.8em;padding:0 .8em 0 9em;font-variant-numeric:tabular-nums"
    return f"<div class='counter' style='{style}'>{escape(text)}</div>"
