"""The panel of the picture: lens, comparisons, screenshots."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import button, draw_field, heading, label, quiet
from iprt.viewer.fields import lens_fields
from iprt.viewer.labels import PARTS


def draw(ui: DesktopState) -> None:
    """Draw the panel."""
    heading("Picture")
    for field in lens_fields(ui):
        draw_field(ui, field)
    heading("Values")
    label("At the mouse", "Values of the pixel, in a corner of the picture (I).")
    ui.readout = imgui.checkbox("##readout", ui.readout)[1]
    heading(PARTS["screenshot"].name)
    about = PARTS["screenshot"].about
    half = 0.5 * (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x)
    if button(f"{icons.ICON_FA_CAMERA}  PNG", f"{about} (F12)", width=half):
        ui.screenshot(".png")
    imgui.same_line()
    if button(f"{icons.ICON_FA_CAMERA}  EXR", f"{about} (Shift+F12)", width=half):
        ui.screenshot(".exr")
    quiet(f"to {ui.folder}")
