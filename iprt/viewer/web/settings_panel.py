"""The panel of the renderer's settings, derived from their model."""

from __future__ import annotations

from html import escape

from iprt.viewer.controls import control_groups, preset_of
from iprt.viewer.fields import quality_field, rate_field, setting_field
from iprt.viewer.web.binding import show
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.inputs import Inputs


class SettingsPanel:
    """The settings panel, for use by the window's thread; all browsers share the settings."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui, gui = ui, ui.client.gui
        self._shown: object = None
        self._inputs = [Inputs(ui, [quality_field(ui)])]
        self._about = gui.add_html("")
        self._inputs.append(Inputs(ui, [rate_field(ui)]))
        for group in control_groups():
            with gui.add_folder(group.name or "general", expand_by_default=False):
                fields = [setting_field(ui, control) for control in group.controls]
                self._inputs.append(Inputs(ui, fields))
        self.sync()

    def sync(self) -> None:
        """Show changed values."""
        settings = self._ui.settings
        if settings is self._shown and not any(inputs.touched for inputs in self._inputs):
            return
        self._shown = settings
        preset = preset_of(settings)
        show(self._about, "content", _differing(preset.text if preset.differing else ""))
        for inputs in self._inputs:
            inputs.sync()


def _differing(text: str) -> str:
    """Return the difference from the preset at a fixed height, so that the inputs stay in place."""
    style = (
        "height:3em;line-height:1.5;font-size:.8em;margin:0 .8em;opacity:.7;overflow:hidden;"
        "overflow-wrap:anywhere"
    )
    return f"<div class='preset' style='{style}' title='{escape(text)}'>{escape(text)}</div>"
