"""The panel of views and playback."""

from __future__ import annotations

from html import escape
from typing import Any

from iprt.viewer.controls import Slider
from iprt.viewer.fields import Field, view_field
from iprt.viewer.labels import PARTS, PLAYBACK, Label
from iprt.viewer.state import PlaybackMode
from iprt.viewer.web.binding import do_on, show
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.inputs import Inputs

EVERY: PlaybackMode = "every frame"
REAL_TIME: PlaybackMode = "real time"


class ScenePanel:
    """The panel of views and playback, for use by the window's thread."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui, gui = ui, ui.client.gui
        self._inputs = [Inputs(ui, [view_field(ui)])]
        self._counter: Any = None
        if len(ui.frames) > 1:
            with gui.add_folder("Video"):
                self._inputs.append(Inputs(ui, _playback(ui)))
                self._counter = gui.add_html("")
            command = gui.add_command("Play or pause", hotkey="space")
            do_on(command.on_trigger, ui.post, ui.toggle_playing)

    def sync(self) -> None:
        """Show changed values."""
        if self._counter is not None:
            counter = self._ui.viewport.counter
            show(self._counter, "content", _counted("" if counter is None else counter.text))
        for inputs in self._inputs:
            inputs.sync()


def _playback(ui: BrowserState) -> list[Field]:
    engine, every, play = ui.engine, PLAYBACK[EVERY], PARTS["play"]
    played = Label(play.name, f"{play.about} Key: space.")
    mode = Label(every.name, f"{every.about} Otherwise: {PLAYBACK[REAL_TIME].about}")
    ends = (Slider(ui.frames[0], ui.frames[-1], True, 0.0),)
    return [
        Field(
            "play",
            "switch",
            lambda: played,
            lambda: ui.playing,
            lambda on: engine.play() if on else engine.pause(),
        ),
        Field("loop", "switch", lambda: PARTS["loop"], lambda: engine.loop, engine.set_loop),
        Field(
            "mode",
            "switch",
            lambda: mode,
            lambda: engine.playback_mode == EVERY,
            lambda on: engine.set_playback_mode(EVERY if on else REAL_TIME),
        ),
        Field(
            "frame",
            "number",
            lambda: PARTS["frame"],
            lambda: ui.frame,
            engine.seek,
            sliders=ends,
        ),
    ]


def _counted(text: str) -> str:
    """Return the counter beside the column of labels, at a fixed height."""
    style = "font-size:.8em;height:1.8em;padding:0 .8em 0 9em;font-variant-numeric:tabular-nums"
    return f"<div class='counter' style='{style}'>{escape(text)}</div>"
