"""Which objects a window shows."""

from __future__ import annotations

from typing import Any

from iprt.viewer.labels import PARTS
from iprt.viewer.objects import ObjectState
from iprt.viewer.web.binding import Binding
from iprt.viewer.web.browser_api import BrowserApi

HINT = "Show or hide it in this window."


class VisiblePanel:
    """A box for each object, which the window shows or hides. The window's thread uses it."""

    def __init__(self, browser: BrowserApi) -> None:
        self._browser = browser
        self._folder = browser.client.gui.add_folder(PARTS["objects"].name, visible=False)
        self._boxes: dict[tuple[str, bool], Binding] = {}
        self.sync()

    def sync(self) -> None:
        states = self._browser.engine.objects
        wanted = [(state.name, state.keyframed) for state in states]
        if wanted != list(self._boxes):
            for box in self._boxes.values():
                box.handle.remove()
            with self._folder:
                self._boxes = {
                    key: self._added(state) for key, state in zip(wanted, states, strict=True)
                }
            self._folder.visible = bool(wanted)
        for box in self._boxes.values():
            box.sync()

    def _added(self, state: ObjectState) -> Binding:
        browser, name = self._browser, state.name
        moved = " Keyframes move it." if state.keyframed else ""
        handle: Any = browser.client.gui.add_checkbox(name, self._shown(name), hint=HINT + moved)
        return Binding(
            handle,
            lambda: self._shown(name),
            lambda on: self._show(name, bool(on)),
            browser.post,
            browser.tell,
        )

    def _shown(self, name: str) -> bool:
        shown = self._browser.viewport.objects
        return shown is None or name in shown

    def _show(self, name: str, on: bool) -> None:
        names = [state.name for state in self._browser.engine.objects]
        shown = [other for other in names if (on if other == name else self._shown(other))]
        self._browser.viewport.show_objects(None if shown == names else tuple(shown))
