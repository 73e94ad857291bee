"""The profile panel: times of each pass in the last view frames."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui, implot

from iprt.viewer.desktop.style import packed
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import heading, quiet
from iprt.viewer.pass_times import WHOLE, PassTimes

PLOT_EM = 13.0
"""Height of the plot."""
OPACITY = 0.85


def draw(ui: DesktopState) -> None:
    """Draw the panel."""
    heading("Passes of the last view frames")
    if not ui.pass_times.steps.size:
        quiet("Nothing has been rendered yet.")
        return
    _plot(ui.pass_times)
    _table(ui.pass_times)
    quiet("iprt profile prints more: kernels, bytes, rays, memory.")


def _plot(pass_times: PassTimes) -> None:
    """Plot the passes' stacked times by view frame."""
    steps, series = pass_times.steps.astype(np.float64), pass_times.series()
    if len(steps) == 1:
        steps, series = np.append(steps, steps + 1.0), {k: v.repeat(2) for k, v in series.items()}
    below = np.zeros(len(steps))
    flags = implot.Flags_.no_legend | implot.Flags_.no_menus | implot.Flags_.no_box_select
    size = imgui.ImVec2(-1.0, PLOT_EM * imgui.get_font_size())
    if not implot.begin_plot("##passes", size, flags):
        return
    locked = implot.AxisFlags_.lock | implot.AxisFlags_.no_highlight
    implot.setup_axes("", "ms", locked | implot.AxisFlags_.no_tick_labels, locked)
    implot.setup_axes_limits(steps[0], steps[-1], 0.0, pass_times.top_ms, imgui.Cond_.always)
    for number, (name, times) in enumerate(series.items()):
        spec = implot.Spec()
        spec.fill_color = _color(number)
        spec.fill_alpha = OPACITY
        implot.plot_shaded(name, steps, below, below + times, spec)
        below = below + times
    implot.end_plot()


def _table(pass_times: PassTimes) -> None:
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_stretch_prop
    if not imgui.begin_table("passes", 4, flags):
        return
    for name, weight in (("pass", 4.0), ("mean ms", 2.2), ("95 %", 1.8), ("share", 1.6)):
        imgui.table_setup_column(name, imgui.TableColumnFlags_.none, weight)
    imgui.table_headers_row()
    places = {name: number for number, name in enumerate(pass_times.series())}
    for row in pass_times.table():
        imgui.table_next_row()
        imgui.table_next_column()
        if row.name != WHOLE:
            _swatch(places[row.name])
        imgui.text_unformatted(row.name)
        for words in (f"{row.mean_ms:.2f}", f"{row.p95_ms:.2f}", f"{100.0 * row.share:.0f} %"):
            imgui.table_next_column()
            imgui.text_unformatted(words)
    imgui.end_table()


def _color(number: int) -> imgui.ImVec4:
    """Return the color of a pass by its index in a frame."""
    return implot.get_colormap_color(number)


def _swatch(number: int) -> None:
    """Draw a square of the pass's color before its name."""
    corner, side = imgui.get_cursor_screen_pos(), imgui.get_font_size()
    color = _color(number)
    low = imgui.ImVec2(corner.x, corner.y + 0.2 * side)
    high = imgui.ImVec2(corner.x + 0.6 * side, corner.y + 0.8 * side)
    shade = packed((color.x, color.y, color.z, OPACITY))
    imgui.get_window_draw_list().add_rect_filled(low, high, shade, 2.0)
    imgui.dummy(imgui.ImVec2(0.6 * side, side))
    imgui.same_line()
