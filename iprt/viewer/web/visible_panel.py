"""The panel of shown objects."""

from __future__ import annotations

from iprt.viewer.fields import Field
from iprt.viewer.labels import PARTS, Label
from iprt.viewer.objects import ObjectState
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.inputs import Inputs

HINT = "Show or hide it in this window."


class VisiblePanel:
    """A check box for each object's visibility, for use by the window's thread."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui = ui
        self._folder = ui.client.gui.add_folder(PARTS["objects"].name, visible=False)
        self._known: list[tuple[str, bool]] = []
        self._boxes = Inputs(ui, ())
        self.sync()

    def sync(self) -> None:
        """Show changed values."""
        states = self._ui.engine.objects
        wanted = [(state.name, state.keyframed) for state in states]
        if wanted != self._known:
            self._known = wanted
            self._boxes.remove()
            with self._folder:
                self._boxes = Inputs(self._ui, map(self._box, states))
            self._folder.visible = bool(wanted)
        self._boxes.sync()

    def _box(self, state: ObjectState) -> Field:
        ui, name = self._ui, state.name
        label = Label(name, HINT + (" Keyframes move it." if state.keyframed else ""))
        return Field(
            name,
            "switch",
            lambda: label,
            lambda: ui.visible(name),
            lambda on: ui.show(name, bool(on)),
        )
