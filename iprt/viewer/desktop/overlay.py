"""Overlay of the picture: tools, the outline of the selection, captions, values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.geometry.camera import View
from iprt.viewer.desktop.gizmo import Matrix, Mode, Rectangle
from iprt.viewer.desktop.style import ACCENT, BAD, QUIET, TEXT, Color, packed
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.widgets import toggle, tooltip
from iprt.viewer.gizmo import NEAR_M, box_edges, path_segments
from iprt.viewer.labels import PARTS
from iprt.viewer.object_states import ObjectState
from iprt.viewer.sun_arrow import COLOR, SunArrow

Box = tuple[float, float, float, float]
"""A box on the screen: left, top, right and bottom."""
MARGIN = 10.0
CAPTION_EM = 34.0
"""Largest width of captions."""
_MODES: tuple[tuple[Mode, str, str], ...] = (
    ("move", icons.ICON_FA_ARROWS_UP_DOWN_LEFT_RIGHT, "Move (T)"),
    ("turn", icons.ICON_FA_ROTATE, "Turn (R)"),
    ("scale", icons.ICON_FA_UP_RIGHT_AND_DOWN_LEFT_FROM_CENTER, "Scale (S)"),
)
_FLOATING = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
)


@contextmanager
def floating(
    name: str, x: float, y: float, *, pivot: tuple[float, float] = (0.0, 0.0), inert: bool = False
) -> Iterator[None]:
    """Open a small window over the picture; `pivot` is its point at (x, y), as fractions."""
    imgui.set_next_window_pos(imgui.ImVec2(x, y), imgui.Cond_.always, imgui.ImVec2(*pivot))
    imgui.set_next_window_bg_alpha(0.8)
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 5.0)
    imgui.push_style_var(imgui.StyleVar_.window_padding, imgui.ImVec2(6, 6))
    imgui.begin(name, None, _FLOATING | (imgui.WindowFlags_.no_inputs if inert else 0))
    yield
    imgui.end()
    imgui.pop_style_var(2)


def toolbar(ui: DesktopState, rectangle: Rectangle) -> None:
    """Draw the gizmo's modes while an object is selected."""
    if ui.state is None:
        return
    left, top, _, _ = rectangle
    with floating("tools", left + MARGIN, top + MARGIN):
        for mode, icon, about in _MODES:
            if toggle(icon, ui.mode == mode, about):
                ui.mode = mode
            imgui.same_line()
        about = f"{PARTS['align'].name} (N). {PARTS['align'].about}"
        if toggle(icons.ICON_FA_MAGNET, ui.align, about):
            ui.align = not ui.align
        imgui.same_line()
        about = f"{PARTS['stepped'].name} (X). {PARTS['stepped'].about}"
        if toggle(icons.ICON_FA_TABLE_CELLS, ui.stepped, about):
            ui.stepped = not ui.stepped


def toolbar_width() -> float:
    """Return the largest width of the toolbar."""
    return 5.0 * (2.0 * imgui.get_frame_height() + imgui.get_style().item_spacing.x) + 2.0 * MARGIN


def split_bar(ui: DesktopState, rectangle: Rectangle, *, lit: bool) -> None:
    """Draw the line between the two compared pictures."""
    lens = ui.viewport.lens
    if lens.against is None or lens.error:
        return
    left, top, width, height = rectangle
    x = round(left + lens.split * width)
    draw = imgui.get_window_draw_list()
    color = packed(ACCENT if lit else TEXT, 1.0 if lit else 0.7)
    draw.add_line(imgui.ImVec2(x, top), imgui.ImVec2(x, top + height), color, 1.0)
    middle = imgui.ImVec2(x, top + 0.5 * height)
    draw.add_circle_filled(middle, 5.0, color)
    if lit:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)


def caption(ui: DesktopState, rectangle: Rectangle) -> None:
    """Draw the caption and warnings of the picture in the upper right corner."""
    displayed = ui.displayed
    words = [] if displayed is None else [(displayed.caption, TEXT), (displayed.warning, ACCENT)]
    words = [(text, color) for text, color in words if text]
    if not words:
        return
    left, top, width, _ = rectangle
    em = imgui.get_font_size()
    room = min(CAPTION_EM * em, width - 4.0 * MARGIN)
    longest = max(imgui.calc_text_size(text, wrap_width=room).x for text, _ in words)
    if ui.state is not None and longest > width - toolbar_width() - 4.0 * MARGIN:
        top += imgui.get_frame_height() + 2.0 * MARGIN  # below the tools
    with floating("caption", left + width - MARGIN, top + MARGIN, pivot=(1, 0), inert=True):
        imgui.push_text_wrap_pos(imgui.get_cursor_pos().x + room)
        _lines(words)
        imgui.pop_text_wrap_pos()


def _lines(lines: Sequence[tuple[str, Color]]) -> None:
    """Draw lines of text, each in its color."""
    for text, color in lines:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*color))
        imgui.text_unformatted(text)
        imgui.pop_style_color()


def activity(ui: DesktopState, rectangle: Rectangle) -> None:
    """Draw compilation, loading, problems and notices at the bottom."""
    status, notice, preview = ui.engine.status, ui.notice, None
    lines = [(text, BAD) for text in status.problems] + [(text, TEXT) for text in status.notes]
    if notice is not None:
        lines.append((notice[0], BAD if notice[1] else TEXT))
    if status.doing in ("compiling", "loading"):
        lines.append((status.text, ACCENT))
    if ui.displayed is not None and ui.displayed.preview is not None:
        preview = ui.displayed.preview
        lines.append((preview.short, TEXT))
    if not lines:
        return
    left, top, width, height = rectangle
    with floating("activity", left + MARGIN, top + height - MARGIN, pivot=(0, 1), inert=True):
        imgui.push_text_wrap_pos(max(width - 4.0 * MARGIN, 80.0))
        _lines(lines)
        imgui.pop_text_wrap_pos()
        # Mouse input passes through the window, so that the picture can be dragged there too.
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    if preview is not None and imgui.is_mouse_hovering_rect(low, high, False):
        tooltip(preview.details)


def readout(ui: DesktopState, rectangle: Rectangle, object_box: Box | None) -> None:
    """Draw the values of the pixel at the mouse, in the corner that covers the least of interest.

    Parameters
    ----------
    ui : DesktopState
    rectangle : (left, top, width, height)
        The picture on the screen.
    object_box : (left, top, right, bottom) or None
        Visible box of the selected object.
    """
    if not ui.readout or ui.cursor is None:
        return
    found = ui.viewport.readout(*ui.cursor)
    if found is None:
        return
    rows = found.rows()
    em, mouse = imgui.get_font_size(), imgui.get_io().mouse_pos
    second, last = (
        max(imgui.calc_text_size(row[column]).x for row in rows) + 1.5 * em for column in (0, 1)
    )
    size = second + last, len(rows) * imgui.get_text_line_height_with_spacing() + MARGIN
    avoid = [(mouse.x - em, mouse.y - em, mouse.x + em, mouse.y + em)]
    avoid += [object_box] if object_box is not None else []
    x, y, pivot = free_corner(rectangle, size, avoid)
    with floating("values", x, y, pivot=pivot, inert=True):
        for label, value in rows:
            imgui.text_colored(imgui.ImVec4(*QUIET), label)
            imgui.same_line(second)
            imgui.text_unformatted(value)


def free_corner(
    rectangle: Rectangle, size: tuple[float, float], avoid: Sequence[Box]
) -> tuple[float, float, tuple[float, float]]:
    """Return the corner of the picture where a window of this size covers the least of `avoid`.

    The lower right corner wins ties. Upper corners leave room for tools and captions.

    Returns
    -------
    (x, y, pivot)
        Arguments of `floating`.
    """
    left, top, width, height = rectangle
    upper = top + imgui.get_frame_height() + 4.0 * MARGIN
    found = []
    for right, down in ((1, 1), (1, 0), (0, 0), (0, 1)):
        x = left + width - MARGIN if right else left + MARGIN
        y = top + height - MARGIN if down else upper
        box = x - right * size[0], y - down * size[1], x, y
        box = (box[0], box[1], box[0] + size[0], box[1] + size[1])
        found.append((sum(_overlap(box, other) for other in avoid), (x, y, (right, down))))
    return min(found, key=lambda entry: entry[0])[1]


def _overlap(one: Box, other: Box) -> float:
    """Return the area of the intersection of two boxes."""
    wide = min(one[2], other[2]) - max(one[0], other[0])
    high = min(one[3], other[3]) - max(one[1], other[1])
    return max(wide, 0.0) * max(high, 0.0)


def outline(
    state: ObjectState, view: View, centre: Matrix, rectangle: Rectangle, *, lit: bool
) -> Box | None:
    """Draw the edges of an object's bounding box; return their extent on the screen."""
    left, top, width, height = rectangle
    scale = np.array([width / view.width, height / view.height])
    draw, color = imgui.get_window_draw_list(), packed(ACCENT, 0.9 if lit else 0.45)
    ends = box_edges(state, view, centre) * scale + (left, top)
    for start, end in ends:
        draw.add_line(imgui.ImVec2(*start), imgui.ImVec2(*end), color, 1.0)
    if not len(ends):
        return None
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def motion_path(ui: DesktopState, state: ObjectState, view: View, rectangle: Rectangle) -> None:
    """Draw the path that keyframes move an object along, with dots at the keys."""
    points, at_keys = ui.timeline.path(state)
    left, top, width, height = rectangle
    scale = np.array([width / view.width, height / view.height])
    draw, color = imgui.get_window_draw_list(), packed(ACCENT, 0.8)
    for start, end in path_segments(points, view, ui.centre) * scale + (left, top):
        draw.add_line(imgui.ImVec2(*start), imgui.ImVec2(*end), color, 2.0)
    seen = at_keys - ui.centre
    before = seen[seen @ view.world_from_view[:, 2] < -NEAR_M]
    for place in view.project(before) * scale + (left, top):
        draw.add_circle_filled(imgui.ImVec2(*place), 4.0, packed(TEXT))


def sun_arrow(arrow: SunArrow, view: View, centre: Matrix, rectangle: Rectangle) -> None:
    """Draw the arrow of the sun's light."""
    drawn = arrow.drawn(view, centre)
    if drawn is None:
        return
    left, top, width, height = rectangle
    drawn = drawn * (width / view.width, height / view.height) + (left, top)
    end, point, one, other = (imgui.ImVec2(*place) for place in drawn)
    draw, em = imgui.get_window_draw_list(), imgui.get_font_size()
    red, green, blue = (part / 255.0 for part in COLOR)
    bright, dark = packed((red, green, blue, 1.0)), packed((0.0, 0.0, 0.0, 0.6))
    # The dark one beneath keeps it visible before a bright picture.
    for shade, wider in ((dark, 3.0), (bright, 0.0)):
        draw.add_line(end, point, shade, 3.0 + wider)
        draw.add_triangle(point, one, other, shade, 1.0 + wider)
        draw.add_triangle_filled(point, one, other, shade)
        draw.add_circle_filled(end, 0.5 * em + 0.5 * wider, shade)
