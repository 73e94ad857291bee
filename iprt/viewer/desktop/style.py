"""The style of the window: colors and fonts."""

from __future__ import annotations

from pathlib import Path

import imgui_bundle
from imgui_bundle import imgui, implot

FONT_PX = 15.0
SPACING_PX = 6.0

Color = tuple[float, float, float, float]
TEXT: Color = (0.86, 0.87, 0.89, 1.0)
QUIET: Color = (0.54, 0.56, 0.60, 1.0)
ACCENT: Color = (0.93, 0.62, 0.24, 1.0)
GOOD: Color = (0.47, 0.76, 0.50, 1.0)
BAD: Color = (0.96, 0.42, 0.38, 1.0)
PANEL: Color = (0.115, 0.119, 0.129, 1.0)
FIELD: Color = (0.185, 0.191, 0.207, 1.0)
FIELD_HOVERED: Color = (0.235, 0.243, 0.263, 1.0)
LINE: Color = (0.21, 0.215, 0.23, 1.0)


def packed(color: Color, alpha: float = 1.0) -> int:
    """Convert a color for draw lists."""
    return int(imgui.get_color_u32((*color[:3], color[3] * alpha)))


def apply_style(scale: float) -> None:
    """Set the colors, sizes and fonts of a new imgui context."""
    style = imgui.get_style()
    imgui.style_colors_dark()
    for names, color in _COLORS.items():
        for name in names.split():
            style.set_color_(getattr(imgui.Col_, name), imgui.ImVec4(*color))
    style.window_rounding = style.window_border_size = 0.0
    style.child_rounding = style.frame_rounding = style.grab_rounding = 3.0
    style.popup_rounding = style.tab_rounding = 4.0
    style.popup_border_size = 1.0
    style.frame_border_size = style.tab_bar_border_size = 0.0
    style.window_padding = imgui.ImVec2(12, 10)
    style.frame_padding = imgui.ImVec2(7, 4)
    style.item_spacing = imgui.ImVec2(SPACING_PX, SPACING_PX)
    style.item_inner_spacing = imgui.ImVec2(6, 4)
    style.cell_padding = imgui.ImVec2(4, 2)
    style.scrollbar_size, style.grab_min_size = 10.0, 10.0
    style.scale_all_sizes(scale)
    style.font_scale_dpi = scale
    _load_fonts()
    plot = implot.get_style()
    plot.plot_padding = imgui.ImVec2(4, 4)
    plot.plot_border_size = 0.0


def _load_fonts() -> None:
    folder = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
    fonts = imgui.get_io().fonts
    fonts.add_font_from_file_ttf(str(folder / "Roboto" / "Roboto-Regular.ttf"), FONT_PX)
    merged = imgui.ImFontConfig()
    merged.merge_mode = True
    merged.glyph_min_advance_x = FONT_PX
    merged.glyph_offset = imgui.ImVec2(0, 1)
    symbols = folder / "Font_Awesome_6_Free-Solid-900.otf"
    fonts.add_font_from_file_ttf(str(symbols), 0.8 * FONT_PX, merged)


_COLORS: dict[str, Color] = {
    "text": TEXT,
    "text_disabled": QUIET,
    "window_bg child_bg": PANEL,
    "popup_bg": (0.14, 0.145, 0.157, 0.98),
    "border separator": LINE,
    "border_shadow": (0.0, 0.0, 0.0, 0.0),
    "frame_bg button": FIELD,
    "frame_bg_hovered frame_bg_active button_hovered": FIELD_HOVERED,
    "button_active": (0.29, 0.30, 0.325, 1.0),
    "check_mark slider_grab_active plot_histogram nav_cursor": ACCENT,
    "slider_grab": (0.62, 0.45, 0.25, 1.0),
    "header": FIELD,
    "header_hovered": FIELD_HOVERED,
    "header_active": (0.29, 0.30, 0.325, 1.0),
    "tab": PANEL,
    "tab_hovered": FIELD_HOVERED,
    "tab_selected": FIELD,
    "tab_selected_overline": ACCENT,
    "scrollbar_bg": (0.0, 0.0, 0.0, 0.0),
    "scrollbar_grab": (0.25, 0.255, 0.27, 1.0),
    "title_bg title_bg_active": FIELD,
    "table_header_bg": FIELD,
    "table_border_light table_border_strong": LINE,
    "table_row_bg_alt": (1.0, 1.0, 1.0, 0.02),
    "modal_window_dim_bg": (0.0, 0.0, 0.0, 0.5),
    "text_selected_bg": (0.93, 0.62, 0.24, 0.35),
}
