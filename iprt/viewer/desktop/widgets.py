"""Pieces of panels: labelled rows, headings, buttons."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from imgui_bundle import imgui

from iprt.files.images import decode_srgb
from iprt.output.display import srgb_encode
from iprt.viewer.desktop.style import ACCENT, QUIET
from iprt.viewer.labels import PARTS, Label

LABEL_SHARE = 0.38
"""Share of a panel's width that labels have."""
VALUE_EM = 5.2
"""Room beside a slider: the same for all values, so that it keeps its length in a drag."""
RESET_EM = 2.4
"""Room for the button that goes back to a default."""


def part(name: str) -> None:
    """As `label`, of what both viewers have."""
    label(PARTS[name].name, PARTS[name].about)


def label(text: str, help_text: str = "") -> None:
    """The left part of a row; the next item takes the rest of it."""
    imgui.align_text_to_frame_padding()
    imgui.text_colored(imgui.ImVec4(*QUIET), text)
    if help_text and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        tooltip(help_text)
    imgui.same_line(LABEL_SHARE * imgui.get_window_width())
    imgui.set_next_item_width(-1.0)


def tooltip(text: str) -> None:
    """Beside the mouse, in lines of a readable length."""
    if imgui.begin_tooltip():
        imgui.push_text_wrap_pos(26.0 * imgui.get_font_size())
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def hint(text: str) -> None:
    """A tooltip of the last item."""
    if text and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        tooltip(text)


def heading(text: str) -> None:
    """Above a group of rows."""
    imgui.spacing()
    imgui.separator_text(text)


def quiet(text: str, *, wrap_em: float | None = None) -> None:
    """Text that does not call for attention, wrapped at the window's width.

    Windows that are as wide as what is in them need a width of its own for it.
    """
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*QUIET))
    imgui.push_text_wrap_pos(0.0 if wrap_em is None else wrap_em * imgui.get_font_size())
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.pop_style_color()


def button(text: str, about: str = "", *, width: float = 0.0, enabled: bool = True) -> bool:
    """Whether it was pressed."""
    with disabled(not enabled):
        pressed = imgui.button(text, imgui.ImVec2(width, 0.0))
    hint(about)
    return bool(pressed)


def toggle(icon: str, on: bool, about: str) -> bool:
    """A button that is lit while something is on; whether it was pressed."""
    if on:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ACCENT))
    pressed = button(icon, about, width=2.0 * imgui.get_frame_height())
    if on:
        imgui.pop_style_color()
    return pressed


@contextmanager
def disabled(off: bool) -> Iterator[None]:
    """What is drawn inside cannot be used."""
    imgui.begin_disabled(off)
    try:
        yield
    finally:
        imgui.end_disabled()


def slider(
    name: str,
    value: float,
    ends: tuple[float, float],
    words: Callable[[float], str],
    *,
    logarithmic: bool = False,
    clamped: bool = True,
) -> float | None:
    """A slider with its value beside it, where the grab does not hide it; what was chosen just now.

    Ctrl and a click take a number. It has as much room as the next item would have.

    Parameters
    ----------
    name : str
    value : float
        Whole numbers are chosen if it is an int.
    ends : (low, high)
        Ends of the slider.
    words : callable
        Tells a value with its unit.
    logarithmic : bool
    clamped : bool
        Typed numbers do not go beyond the ends.
    """
    low, high = ends
    gap = imgui.get_style().item_inner_spacing.x
    room = VALUE_EM * imgui.get_font_size()
    flags = int(imgui.SliderFlags_.logarithmic) if logarithmic else 0
    flags |= int(imgui.SliderFlags_.always_clamp) if clamped else 0
    imgui.set_next_item_width(imgui.calc_item_width() - room - gap)
    changed, chosen = False, value
    # Without a format: no number over the slider.
    if isinstance(value, int):
        changed, chosen = imgui.slider_int(name, value, round(low), round(high), "", flags)
    else:
        changed, chosen = imgui.slider_float(name, value, low, high, "", flags)
    imgui.same_line(0.0, gap)
    imgui.align_text_to_frame_padding()
    text = words(chosen)
    left = imgui.get_cursor_pos().x
    imgui.set_cursor_pos_x(left + room - imgui.calc_text_size(text).x)
    imgui.text_unformatted(text)
    return chosen if changed else None


def choice(
    name: str,
    options: Sequence[Label],
    chosen: int,
    *,
    missing: Mapping[int, str] | None = None,
) -> int | None:
    """A list to choose from; the index that was chosen just now.

    Parameters
    ----------
    name : str
    options : sequence of Label
    chosen : int
    missing : mapping of int to str
        Why some of them cannot be chosen now.
    """
    missing = missing or {}
    if not imgui.begin_combo(name, options[chosen].name):
        hint(options[chosen].about)
        return None
    picked = None
    for index, option in enumerate(options):
        with disabled(index in missing):
            if imgui.selectable(option.name, index == chosen)[0]:
                picked = index
        hint(missing.get(index, option.about))
    imgui.end_combo()
    return picked


def linear_color(name: str, color: tuple[float, float, float]) -> tuple[float, float, float] | None:
    """A colour picker of linear Rec.709 in [0, 1], shown as it looks; what was chosen just now."""
    shown = [float(value) for value in srgb_encode(np.clip(color, 0.0, 1.0))]
    changed, picked = imgui.color_edit3(name, shown, imgui.ColorEditFlags_.float)
    if not changed:
        return None
    levels = np.rint(65535.0 * np.clip(list(picked)[:3], 0.0, 1.0)).astype(np.uint16)
    red, green, blue = (round(float(value), 5) for value in decode_srgb(levels))
    return red, green, blue
