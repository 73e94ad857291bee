"""The panel of renders to files: the form, and the queue."""

from __future__ import annotations

from html import escape
from typing import Any

from iprt.viewer.actions import Action
from iprt.viewer.labels import Label
from iprt.viewer.render_fields import (
    QUEUE,
    TAB,
    queue_actions,
    render_fields,
    render_words,
    submit_action,
)
from iprt.viewer.render_form import RenderForm
from iprt.viewer.render_queue import Render
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.handles import show
from iprt.viewer.web.inputs import Inputs

STYLE = "font-size:.8em;margin:.4em .8em;overflow-wrap:anywhere"


class RenderPanel:
    """Form and queue, for use by the window's thread.

    Files are written on the server's machine, from where single ones can be downloaded.
    """

    def __init__(self, ui: BrowserState) -> None:
        self._ui, self._gui = ui, ui.client.gui
        self._form = RenderForm(ui)
        self._gui.add_markdown(TAB.about)
        fields, submit = render_fields(ui, self._form), submit_action(self._form)
        self._inputs = Inputs(ui, [*fields, submit], sparse=True)
        self._below = self._gui.add_html("")
        self._queue = self._gui.add_folder(QUEUE.name, visible=False)
        self._rows: dict[int, Row] = {}

    def sync(self) -> None:
        """Show changed values, and the state of the queue."""
        self._inputs.sync()
        problem = self._form.problem
        place = _plain("render-place", self._form.place)
        show(self._below, "content", _bad("render-problem", problem) if problem else place)
        renders = {render.number: render for render in self._ui.engine.renders.renders}
        show(self._queue, "visible", bool(renders))
        for number in self._rows.keys() - renders.keys():
            self._rows.pop(number).remove()
        for number, render in renders.items():
            if number not in self._rows:
                with self._queue:
                    self._rows[number] = Row(self._ui, render)
            self._rows[number].sync(render)


class Row:
    """A render in the queue."""

    def __init__(self, ui: BrowserState, render: Render) -> None:
        gui, number, order = ui.client.gui, render.number, render.order
        self._folder: Any = gui.add_folder(order.output.name)

        def download() -> None:
            content = order.output.read_bytes()
            ui.client.send_file_download(order.output.name, content, save_immediately=True)

        def finished() -> bool:
            renders = ui.engine.renders.renders
            return any(r.number == number and r.state == "finished" for r in renders)

        about = Label("Download", "Sends the file to this browser.")
        more = [Action(f"download {number}", about, download, visible=finished)]
        with self._folder:
            self._words, self._bar = gui.add_html(""), gui.add_progress_bar(0.0)
            actions = [*([] if order.numbered else more), *queue_actions(ui, number)]
            self._buttons = Inputs(ui, actions)

    def sync(self, render: Render) -> None:
        """Show the state of the render."""
        words = render_words(render)
        told = _bad if render.state == "failed" else _plain
        show(self._words, "content", told("render-state", words))
        show(self._bar, "value", round(100.0 * render.share, 1))
        self._buttons.sync()

    def remove(self) -> None:
        """Remove it from the page."""
        self._folder.remove()


def _plain(kind: str, text: str) -> str:
    return f"<div class='{kind}' style='{STYLE}'>{escape(text)}</div>"


def _bad(kind: str, text: str) -> str:
    return f"<div class='{kind}' style='{STYLE};color:#ff8787'>{escape(text)}</div>"
