"""Pieces of panels: labelled rows, headings, buttons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from imgui_bundle import imgui

from iprt.measure.metrics import srgb_encode
from iprt.scene.images import decode_srgb
from iprt.viewer.desktop.style import QUIET

LABEL_SHARE = 0.38
"""Of a panel's width, for labels."""


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


def quiet(text: str) -> None:
    """Text that wraps and does not call for attention."""
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*QUIET))
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.pop_style_color()


def button(text: str, about: str = "", *, width: float = 0.0, enabled: bool = True) -> bool:
    """Whether it was pressed."""
    with disabled(not enabled):
        pressed = imgui.button(text, imgui.ImVec2(width, 0.0))
    hint(about)
    return bool(pressed)


@contextmanager
def disabled(off: bool) -> Iterator[None]:
    """What is drawn inside cannot be used."""
    imgui.begin_disabled(off)
    try:
        yield
    finally:
        imgui.end_disabled()


def choice(name: str, options: Sequence[str], chosen: int) -> int | None:
    """A list to choose from; the index that was chosen just now."""
    changed, index = imgui.combo(name, chosen, list(options))
    return index if changed else None


def linear_color(name: str, color: tuple[float, float, float]) -> tuple[float, float, float] | None:
    """A colour picker of linear Rec.709 in [0, 1], shown as it looks; what was chosen just now."""
    shown = [float(value) for value in srgb_encode(np.clip(color, 0.0, 1.0))]
    changed, picked = imgui.color_edit3(name, shown, imgui.ColorEditFlags_.float)
    if not changed:
        return None
    levels = np.rint(65535.0 * np.clip(list(picked)[:3], 0.0, 1.0)).astype(np.uint16)
    red, green, blue = (round(float(value), 5) for value in decode_srgb(levels))
    return red, green, blue
