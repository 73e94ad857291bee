"""Widgets of panels: labelled rows, headings, buttons."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.errors import IprtError
from iprt.files.images import decode_srgb, srgb_encode
from iprt.viewer.actions import Action
from iprt.viewer.controls import DIGITS
from iprt.viewer.desktop.style import ACCENT, QUIET
from iprt.viewer.fields import Field
from iprt.viewer.labels import Label
from iprt.viewer.ui_state import UiState

LABEL_SHARE = 0.38
"""Width of labels as a fraction of the panel's width."""
VALUE_EM = 5.2
"""Room for the value beside a slider, the same for all values: the slider keeps its length in a
drag."""
RESET_EM = 2.4
"""Room for the button that resets a value."""


def label(text: str, help_text: str = "", *, lit: bool = False) -> None:
    """Draw the label of a row, lit or subdued; the next item fills the rest."""
    imgui.align_text_to_frame_padding()
    imgui.text_colored(imgui.ImVec4(*(ACCENT if lit else QUIET)), text)
    if help_text and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        tooltip(help_text)
    imgui.same_line(LABEL_SHARE * imgui.get_window_width())
    imgui.set_next_item_width(-1.0)


def tooltip(text: str) -> None:
    """Draw a tooltip at the mouse, wrapped to a readable width."""
    if imgui.begin_tooltip():
        imgui.push_text_wrap_pos(26.0 * imgui.get_font_size())
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def hint(text: str) -> None:
    """Attach a tooltip to the last item."""
    if text and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
        tooltip(text)


def heading(text: str) -> None:
    """Draw a heading above a group of rows."""
    imgui.spacing()
    imgui.separator_text(text)


def quiet(text: str, *, wrap_em: float | None = None) -> None:
    """Draw subdued text, wrapped at the window's width.

    Windows that fit their contents need an explicit width (`wrap_em`).
    """
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*QUIET))
    imgui.push_text_wrap_pos(0.0 if wrap_em is None else wrap_em * imgui.get_font_size())
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.pop_style_color()


def button(text: str, about: str = "", *, width: float = 0.0, enabled: bool = True) -> bool:
    """Draw a button; return True if it was pressed."""
    with disabled(not enabled):
        pressed = imgui.button(text, imgui.ImVec2(width, 0.0))
    hint(about)
    return bool(pressed)


def action_button(action: Action, icon: str, *, width: float, short: bool = False) -> None:
    """Draw the button of an action, and run it; a short one shows the icon alone."""
    text = icon if short else f"{icon}  {action.label.name}".strip()
    if button(f"{text}##{action.name}", action.hint, width=width, enabled=action.enabled()):
        action.act()


def toggle(icon: str, on: bool, about: str) -> bool:
    """Draw a button that is lit while `on`; return True if it was pressed."""
    if on:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*ACCENT))
    pressed = button(icon, about, width=2.0 * imgui.get_frame_height())
    if on:
        imgui.pop_style_color()
    return pressed


@contextmanager
def disabled(off: bool) -> Iterator[None]:
    """Disable the widgets drawn inside."""
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
    """Draw a slider with its value beside it; return the newly chosen value, or None.

    The value does not cover the grab. Ctrl and a click allow typing. The width is the next item's.

    Parameters
    ----------
    name : str
    value : float
        An int restricts the slider to integers.
    ends : (low, high)
        Ends of the slider.
    words : callable
        Formats a value with its unit.
    logarithmic : bool
    clamped : bool
        Limit typed numbers to the ends.
    """
    low, high = ends
    gap = imgui.get_style().item_inner_spacing.x
    room = VALUE_EM * imgui.get_font_size()
    flags = int(imgui.SliderFlags_.logarithmic) if logarithmic else 0
    flags |= int(imgui.SliderFlags_.always_clamp) if clamped else 0
    imgui.set_next_item_width(imgui.calc_item_width() - room - gap)
    changed, chosen = False, value
    # An empty format hides the number on the slider.
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
    """Draw a list to choose from; return the newly chosen index, or None.

    Parameters
    ----------
    name : str
    options : sequence of Label
    chosen : int
    missing : mapping of int to str
        Reasons why options cannot be chosen now.
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


def draw_field(ui: UiState, field: Field) -> None:
    """Draw a row with an input, and write its changes."""
    words, now = field.label(), field.read()
    label(words.name, words.about, lit=field.changed)
    resettable = field.default is not None
    if resettable:
        imgui.set_next_item_width(-RESET_EM * imgui.get_font_size())
    with disabled(not field.enabled()):
        value = _drawn(field, now)
    if resettable and now != field.default:
        imgui.same_line(imgui.get_window_width() - RESET_EM * imgui.get_font_size())
        if button(f"{icons.ICON_FA_ROTATE_LEFT}##{field.key}", "Back to the default"):
            value = field.default
    if value != now:
        try:
            field.write(value)
        except IprtError as error:
            ui.say(str(error), bad=True)


def _drawn(field: Field, now: Any) -> Any:
    """Draw the input; return its value, changed or not."""
    name = f"##{field.key}"
    if field.kind == "switch":
        return imgui.checkbox(name, now)[1]
    if field.kind == "choice":
        options, missing = field.options(), field.missing()
        values = list(options)
        reasons = {values.index(value): reason for value, reason in missing.items()}
        index = choice(name, list(options.values()), values.index(now), missing=reasons)
        return now if index is None else values[index]
    if field.kind == "color":
        color = _linear_color(name, now)
        hint(field.label().about)
        return now if color is None else color
    if field.kind == "vector":
        changed, moved = imgui.drag_float3(name, list(now), *_pace(field.unit))
        return tuple(moved) if changed else now
    if field.kind in ("file", "text"):
        entered, path = imgui.input_text(name, now, imgui.InputTextFlags_.enter_returns_true)
        hint(field.label().about)
        return path if entered else now
    return _number(name, now, field)


def _pace(unit: str) -> tuple[float, float, float, str]:
    """Return the step per pixel of a drag, no limits, and the format of a vector in a unit."""
    return (0.5, 0.0, 0.0, "%.1f°") if unit == "°" else (0.005, 0.0, 0.0, f"%.3f {unit}")


def _number(name: str, now: float, field: Field) -> float:
    """Draw a slider that accepts typed numbers."""
    of = field.slider
    assert of is not None

    def words(value: float) -> str:
        digits = f"{value:.0f}" if of.whole or value >= 10**DIGITS else f"{value:.{DIGITS}g}"
        return f"{digits} {field.unit}".rstrip()

    chosen = slider(
        name,
        int(now) if of.whole else float(now),
        (of.low, of.high),
        words,
        logarithmic=of.logarithmic,
        clamped=not field.beyond,
    )
    if chosen is None:
        return now
    return int(chosen) if of.whole else float(f"{chosen:.{DIGITS}g}")


def _linear_color(
    name: str, color: tuple[float, float, float]
) -> tuple[float, float, float] | None:
    """Draw a color picker for linear Rec.709 in [0, 1]; return a newly chosen color, or None."""
    shown = [float(value) for value in srgb_encode(np.clip(color, 0.0, 1.0))]
    changed, picked = imgui.color_edit3(name, shown, imgui.ColorEditFlags_.float)
    if not changed:
        return None
    levels = np.rint(65535.0 * np.clip(list(picked)[:3], 0.0, 1.0)).astype(np.uint16)
    red, green, blue = (round(float(value), 5) for value in decode_srgb(levels))
    return red, green, blue
