"""The panel of the renderer's settings, derived from their model."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.settings.model import Settings
from iprt.viewer.controls import compared_presets, preset_of
from iprt.viewer.desktop.style import ACCENT
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import button, draw_field, heading, hint, label, quiet
from iprt.viewer.labels import PARTS
from iprt.viewer.setting_fields import quality_field, rate_field

RESET_SHARE = 0.6
"""Position of the button that resets all settings, as a fraction of the panel's width."""


def draw(ui: DesktopState) -> None:
    """Draw the presets, a search, and all settings by group."""
    _preset(ui)
    draw_field(ui, rate_field(ui))
    _presets(ui)
    imgui.set_next_item_width(-1.0)
    hinted = f"{icons.ICON_FA_MAGNIFYING_GLASS}  {PARTS['search'].name}"
    ui.search = imgui.input_text_with_hint("##search", hinted, ui.search)[1]
    found = 0
    for words, fields in ui.setting_groups:
        shown = [field for field in fields if field.matches(ui.search)]
        found += len(shown)
        if not shown:
            continue
        changed = sum(field.changed for field in fields)
        if ui.search.strip():
            heading(words.name)
            unfolded = True
        else:
            note = f"   ({changed} changed)" if changed else ""
            unfolded = imgui.collapsing_header(f"{words.name}{note}###{words.name}")
            hint(words.about)
        for field in shown if unfolded else ():
            draw_field(ui, field)
    if not found:
        quiet("No setting has these words.")


def _presets(ui: DesktopState) -> None:
    """Draw a table of the settings that differ between presets."""
    if not imgui.tree_node(PARTS["presets"].name):
        return
    rows = compared_presets(ui.settings)
    names = list(next(iter(rows.values())))
    flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.scroll_x
    height = (len(rows) + 2.5) * imgui.get_text_line_height_with_spacing()
    if imgui.begin_table("presets", 1 + len(names), flags, imgui.ImVec2(0.0, height)):
        imgui.table_setup_column("")
        for name in names:
            imgui.table_setup_column(name)
        imgui.table_headers_row()
        for key, row in rows.items():
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_unformatted(key)
            for name in names:
                imgui.table_next_column()
                if row[name] == row["now"]:
                    imgui.text_colored(imgui.ImVec4(*ACCENT), row[name])
                else:
                    imgui.text_unformatted(row[name])
        imgui.end_table()
    imgui.tree_pop()


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
