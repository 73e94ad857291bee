"""The rows of the panel that edit the scene's views."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import action_button, draw_field
from iprt.viewer.timeline_fields import timeline_actions, view_name_field

_EDITS = (
    ("add view", icons.ICON_FA_PLUS),
    ("look", icons.ICON_FA_LOCATION_CROSSHAIRS),
    ("remove view", icons.ICON_FA_TRASH),
)


def draw(ui: DesktopState) -> None:
    """Draw the name of the last view, and the buttons that add, turn and remove views."""
    if ui.timeline.view is not None:
        draw_field(ui, view_name_field(ui))
    shared = timeline_actions(ui)
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (len(_EDITS) - 1)) / len(_EDITS)
    for name, icon in _EDITS:
        action_button(shared[name], icon, width=width, short=True)
        imgui.same_line()
    imgui.new_line()
