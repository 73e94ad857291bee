"""The panel of the renderer's settings, derived from their model."""

from __future__ import annotations

from imgui_bundle import imgui

from iprt.settings.model import Settings
from iprt.viewer.controls import control_groups, preset_of
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import (
    button,
    draw_field,
    heading,
    hint,
    label,
)
from iprt.viewer.fields import quality_field, rate_field, setting_field

RESET_SHARE = 0.6
"""Position of the button that resets all settings, as a fraction of the panel's width."""


def draw(ui: DesktopState) -> None:
    """Draw the panel."""
    _preset(ui)
    draw_field(ui, rate_field(ui))
    for group in control_groups():
        name = group.name or "general"
        unfolded = imgui.collapsing_header(name.replace("_", " "))
        hint(group.about)
        for control in group.controls if unfolded else ():
            draw_field(ui, setting_field(ui, control))


def _preset(ui: DesktopState) -> None:
    heading("Quality")
    draw_field(ui, quality_field(ui))
    # Always drawn: rows that come and go would move a slider during a drag.
    preset = preset_of(ui.settings)
    count = len(preset.differing)
    label("Changed settings", "Number of settings that differ from the preset.")
    imgui.text_unformatted(str(count or "none"))
    hint(preset.text if count else "")
    imgui.same_line(RESET_SHARE * imgui.get_window_width())
    about = "Set everything to its default"
    if button("Reset all", about, width=-1.0, enabled=ui.settings != Settings()):
        ui.settings = Settings()
