"""What lies over the picture: tools, the outline of what is selected, captions, values."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations

import numpy as np
from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui
from numpy.typing import NDArray

from iprt.scene.camera import View
from iprt.viewer.desktop.desk import Desk
from iprt.viewer.desktop.gizmo import Matrix, Mode, Rectangle, camera_matrix
from iprt.viewer.desktop.style import ACCENT, BAD, QUIET, TEXT, packed
from iprt.viewer.sight import Readout

MARGIN = 10.0
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
_CORNERS = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)])
_EDGES = [(a, b) for a, b in combinations(range(8), 2) if (a ^ b).bit_count() == 1]


@contextmanager
def floating(
    name: str, x: float, y: float, *, pivot: tuple[float, float] = (0.0, 0.0), inert: bool = False
) -> Iterator[None]:
    """A small window over the picture, `pivot` of which, as shares of its size, is at a point."""
    imgui.set_next_window_pos(imgui.ImVec2(x, y), imgui.Cond_.always, imgui.ImVec2(*pivot))
    imgui.set_next_window_bg_alpha(0.8)
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 5.0)
    imgui.push_style_var(imgui.StyleVar_.window_padding, imgui.ImVec2(6, 6))
    imgui.begin(name, None, _FLOATING | (imgui.WindowFlags_.no_inputs if inert else 0))
    yield
    imgui.end()
    imgui.pop_style_var(2)


def toolbar(desk: Desk, rectangle: Rectangle) -> None:
    """How the gizmo works, while an object is selected."""
    if desk.state is None:
        return
    left, top, _, _ = rectangle
    with floating("tools", left + MARGIN, top + MARGIN):
        for mode, icon, about in _MODES:
            if _toggle(icon, desk.mode == mode, about):
                desk.mode = mode
            imgui.same_line()
        about = "Slide over surfaces: upright, or turned to the surface's normal (N)"
        if _toggle(icons.ICON_FA_MAGNET, desk.align, about):
            desk.align = not desk.align


def toolbar_width() -> float:
    """At most."""
    return 4.0 * (2.0 * imgui.get_frame_height() + imgui.get_style().item_spacing.x) + 2.0 * MARGIN


def _toggle(icon: str, on: bool, about: str) -> bool:
    if on:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ACCENT))
    pressed = imgui.button(icon, imgui.ImVec2(2.0 * imgui.get_frame_height(), 0.0))
    if on:
        imgui.pop_style_color()
    imgui.set_item_tooltip(about)
    return bool(pressed)


def split_bar(desk: Desk, rectangle: Rectangle, *, lit: bool) -> None:
    """The line between the picture and what it is compared with."""
    lens = desk.viewport.lens
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


def corners(desk: Desk, rectangle: Rectangle) -> None:
    """In the upper right corner: which buffer is shown, and what it is compared with."""
    sight, lens = desk.sight, desk.viewport.lens
    caption = "" if sight is None else sight.caption
    words = [word for word in (lens.buffer if lens.against is None else "", caption) if word]
    if not words:
        return
    left, top, width, _ = rectangle
    text = "   ".join(words)
    size = imgui.calc_text_size(text)
    x, y = left + width - size.x - 2.0 * MARGIN, top + MARGIN
    if desk.state is not None and x < left + 2.0 * MARGIN + toolbar_width():
        y += imgui.get_frame_height() + 2.0 * MARGIN  # below the tools
    draw = imgui.get_window_draw_list()
    box = imgui.ImVec2(x - 8, y), imgui.ImVec2(x + size.x + 8, y + size.y + 8)
    draw.add_rect_filled(*box, packed((0.1, 0.1, 0.11, 0.8)), 5.0)
    draw.add_text(imgui.ImVec2(x, y + 4), packed(TEXT), text)


def activity(desk: Desk, rectangle: Rectangle) -> None:
    """At the bottom: what is compiled or loaded, what went wrong, what was just done."""
    status, notice = desk.engine.status, desk.notice
    lines = [(text, BAD) for text in status.problems]
    if notice is not None:
        lines.append((notice[0], BAD if notice[1] else TEXT))
    if status.doing in ("compiling", "loading"):
        lines.append((f"{status.doing} {status.what} ...", ACCENT))
    if desk.sight is not None and desk.sight.gave_up:
        lines.append((f"while it moves: {desk.sight.gave_up}", QUIET))
    if not lines:
        return
    left, top, width, height = rectangle
    with floating("activity", left + MARGIN, top + height - MARGIN, pivot=(0, 1), inert=True):
        imgui.push_text_wrap_pos(max(width - 4.0 * MARGIN, 80.0))
        for text, color in lines:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*color))
            imgui.text_unformatted(text)
            imgui.pop_style_color()
        imgui.pop_text_wrap_pos()


def readout(desk: Desk) -> None:
    """The values of the pixel at the cursor, beside it."""
    if not desk.readout or desk.cursor is None:
        return
    found = desk.viewport.readout(*desk.cursor)
    if found is None or not imgui.begin_tooltip():
        return
    for label, value in readout_rows(found, desk.viewport.lens.buffer):
        imgui.text_colored(imgui.ImVec4(*QUIET), label)
        imgui.same_line(5.2 * imgui.get_font_size())
        imgui.text_unformatted(value)
    imgui.end_tooltip()


def readout_rows(found: Readout, buffer: str | None) -> list[tuple[str, str]]:
    """What a pixel holds, in words."""
    rows = [("pixel", f"{found.x}, {found.y}"), ("linear", _numbers(found.radiance))]
    if found.depth_m is not None:
        rows.append(("depth", f"{found.depth_m:.3f} m" if found.depth_m < np.inf else "open sky"))
    if found.normal is not None:
        rows.append(("normal", "  ".join(f"{value:+.2f}" for value in found.normal)))
    if found.name is not None:
        rows.append(("object", found.name))
    if buffer is not None and found.value is not None:
        rows.append((buffer, f"{_numbers(found.value)} {found.unit}".rstrip()))
    return rows


def _numbers(values: NDArray[np.float32]) -> str:
    return "  ".join(f"{value:.4g}" for value in values)


def box(
    to_world: Matrix,
    corners: tuple[Matrix, Matrix],
    view: View,
    pose: Matrix | None,
    rectangle: Rectangle,
) -> None:
    """The edges of an object's bounding box, where they are in front of the camera."""
    low, high = corners
    points = (low + _CORNERS * (high - low)) @ to_world[:3, :3].T + to_world[:3, 3]
    camera = camera_matrix(view, pose)
    local = points @ camera[:3, :3].T + camera[:3, 3]
    left, top, width, height = rectangle
    scale = height * view.focal_px / view.height
    draw = imgui.get_window_draw_list()
    color = packed(ACCENT, 0.45)
    for a, b in _EDGES:
        if local[a, 2] < -1e-3 and local[b, 2] < -1e-3:
            start, end = (
                imgui.ImVec2(
                    left + 0.5 * width - scale * local[i, 0] / local[i, 2],
                    top + 0.5 * height + scale * local[i, 1] / local[i, 2],
                )
                for i in (a, b)
            )
            draw.add_line(start, end, color, 1.0)
