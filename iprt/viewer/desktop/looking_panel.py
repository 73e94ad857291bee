"""Snapshots, distribution and pinned pixels in the panel of the picture."""

from __future__ import annotations

import numpy as np
from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.viewer.actions import actions
from iprt.viewer.desktop.gizmo import Rectangle
from iprt.viewer.desktop.style import ACCENT, QUIET, TEXT, packed
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import action_button, draw_field, heading, label, quiet
from iprt.viewer.distribution import BINS, Distribution
from iprt.viewer.labels import PARTS
from iprt.viewer.looking import flipped, pinned
from iprt.viewer.looking_fields import range_fields

PLOT_EM, BAR_EM = 4.0, 0.8
"""Heights of the histogram and of the color bar."""
CROSS_PX = 5.0
SNAPSHOTS = (
    ("snapshot", icons.ICON_FA_CAMERA),
    ("flip", icons.ICON_FA_RIGHT_LEFT),
    ("back to snapshot", icons.ICON_FA_CLOCK_ROTATE_LEFT),
)


def draw(ui: DesktopState) -> None:
    """Draw the parts below the lens."""
    shared = actions(ui)
    heading(PARTS["snapshot"].name)
    gap = imgui.get_style().item_spacing.x
    third = (imgui.get_content_region_avail().x - 2.0 * gap) / 3.0
    for name, icon in SNAPSHOTS:
        action_button(shared[name], icon, width=third, short=name != "snapshot")
        imgui.same_line()
    imgui.new_line()
    if flipped(ui):
        quiet("The snapshot is shown; B shows the picture again.")
    heading("Values")
    if ui.distribution is not None:
        _draw_distribution(ui.distribution)
        if ui.distribution.scaled:
            for field in range_fields(ui):
                draw_field(ui, field)
    if shared["auto range"].visible():
        label("")
        action_button(shared["auto range"], "", width=-1.0)
    label("At the mouse", "Values of the pixel, in a corner of the picture (I).")
    ui.readout = imgui.checkbox("##readout", ui.readout)[1]
    _draw_pins(ui)


def _draw_distribution(found: Distribution) -> None:
    """Draw the histogram above the color bar, with the ends of the range."""
    em, draw = imgui.get_font_size(), imgui.get_window_draw_list()
    corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    shares = np.sqrt(found.counts / max(found.counts.max(), 1))
    bottom = corner.y + PLOT_EM * em
    for number, (share, color) in enumerate(zip(shares, found.colors, strict=True)):
        left, right = (corner.x + width * (number + side) / BINS for side in (0, 1))
        top = imgui.ImVec2(left, bottom - share * PLOT_EM * em)
        draw.add_rect_filled(top, imgui.ImVec2(right, bottom), packed(QUIET))
        red, green, blue = (float(part) / 255.0 for part in color)
        end = imgui.ImVec2(right, bottom + BAR_EM * em)
        draw.add_rect_filled(imgui.ImVec2(left, bottom), end, packed((red, green, blue, 1.0)))
    imgui.dummy(imgui.ImVec2(width, (PLOT_EM + BAR_EM) * em))
    low, high = found.ends
    imgui.text_colored(imgui.ImVec4(*QUIET), low)
    imgui.same_line(imgui.get_content_region_avail().x - imgui.calc_text_size(high).x)
    imgui.text_colored(imgui.ImVec4(*QUIET), high)


def _draw_pins(ui: DesktopState) -> None:
    shared = actions(ui)
    if not ui.viewport.pins:
        quiet("Shift+click into the picture pins the values of a pixel.")
        return
    for number, values in enumerate(pinned(ui), 1):
        for row, (name, words) in enumerate(values.rows()):
            label(f"{number}   {name}" if row == 0 else f"     {name}")
            imgui.text_unformatted(words)
    label("")
    action_button(shared["unpin"], icons.ICON_FA_XMARK, width=-1.0)


def draw_crosses(ui: DesktopState, rectangle: Rectangle) -> None:
    """Mark the pinned pixels in the picture, with their numbers."""
    left, top, width, height = rectangle
    draw = imgui.get_window_draw_list()
    for number, (x, y) in enumerate(ui.viewport.pins, 1):
        place = np.array([left + x * width, top + y * height])
        for color, thick in ((packed((0.0, 0.0, 0.0, 0.7)), 3.0), (packed(ACCENT), 1.0)):
            for side in (np.array([CROSS_PX, 0.0]), np.array([0.0, CROSS_PX])):
                draw.add_line(
                    imgui.ImVec2(*(place - side)), imgui.ImVec2(*(place + side)), color, thick
                )
        draw.add_text(imgui.ImVec2(*(place + 4.0)), packed(TEXT), str(number))
