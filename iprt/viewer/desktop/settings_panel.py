"""The panel of the renderer's settings, made from their model."""

from __future__ import annotations

from typing import Any

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.errors import IprtError
from iprt.settings.model import Settings
from iprt.settings.presets import PRESETS
from iprt.viewer.controls import (
    DIGITS,
    Control,
    Slider,
    control_groups,
    preset_of,
    value_of,
    with_preset,
    with_value,
)
from iprt.viewer.desktop.ui_state import UiState
from iprt.viewer.desktop.widgets import (
    RESET_EM,
    button,
    choice,
    disabled,
    heading,
    hint,
    label,
    part,
    slider,
)
from iprt.viewer.labels import Label

USUAL_FPS, MOST_FPS = 30, 120
_UNSET = "automatic"
RESET_SHARE = 0.6
"""Share of the panel's width at which the button that resets all settings begins."""


def draw(ui: UiState) -> None:
    """The whole panel."""
    settings = ui.settings
    _preset(ui, settings)
    _pace(ui)
    for group in control_groups():
        name = group.name or "general"
        if not imgui.collapsing_header(name.replace("_", " ")):
            hint(group.about)
            continue
        hint(group.about)
        for control in group.controls:
            _row(ui, settings, control)


def _preset(ui: UiState, settings: Settings) -> None:
    heading("Quality")
    preset, names = preset_of(settings), list(PRESETS)
    label("Preset", "Sets what differs most in cost; all other settings stay as they are.")
    options = [Label(name, "") for name in names]
    chosen = choice("##preset", options, names.index(preset.quality))
    if chosen is not None:
        ui.settings = with_preset(settings, names[chosen])
    # Always there: rows that come and go would move the slider that is being dragged.
    count = len(preset.differing)
    label("Changed settings", "Those that differ from the preset.")
    imgui.text_unformatted(str(count or "none"))
    hint(preset.text if count else "")
    imgui.same_line(RESET_SHARE * imgui.get_window_width())
    about = "Set everything to its default"
    if button("Reset all", about, width=-1.0, enabled=settings != Settings()):
        ui.settings = Settings()


def _pace(ui: UiState) -> None:
    viewport = ui.viewport
    part("fps")
    held = viewport.target_fps is not None
    changed, held = imgui.checkbox("##held", held)
    if changed:
        viewport.target_fps = USUAL_FPS if held else None
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    with disabled(not held):
        now = round(viewport.target_fps or USUAL_FPS)
        fps = slider("##fps", now, (1, MOST_FPS), "{} fps".format, logarithmic=True)
    if fps is not None and held:
        viewport.target_fps = fps


def _row(ui: UiState, settings: Settings, control: Control) -> None:
    now = value_of(settings, control.key)
    label(control.label, f"{control.help}\n\n{control.key}: {control.allowed}")
    start = value_of(Settings(), control.key)
    imgui.set_next_item_width(-RESET_EM * imgui.get_font_size())
    value = _value(control, now)
    if now != start:
        imgui.same_line(imgui.get_window_width() - RESET_EM * imgui.get_font_size())
        if button(f"{icons.ICON_FA_ROTATE_LEFT}##{control.key}", "Back to the default"):
            value = start
    if value != now:
        try:
            ui.settings = with_value(settings, control.key, value)
        except IprtError as error:
            ui.say(str(error), bad=True)


def _value(control: Control, now: Any) -> Any:
    """The control, drawn; its value, changed or not."""
    name = f"##{control.key}"
    if now is None:
        pressed = imgui.button(f"{_UNSET}{name}", imgui.ImVec2(imgui.calc_item_width(), 0.0))
        return control.start if pressed else None
    if control.kind == "switch":
        return imgui.checkbox(name, now)[1]
    if control.kind == "choice":
        options = [Label(word, "") for word in control.choices]
        index = choice(name, options, control.choices.index(now))
        return now if index is None else control.choices[index]
    if control.kind == "numbers":
        return _numbers(control, list(now))
    return _number(name, control.sliders[0], now, control.unit)


def _numbers(control: Control, now: list[float]) -> list[float]:
    style = imgui.get_style()
    spacing = style.item_inner_spacing.x
    width = (imgui.calc_item_width() - spacing * (len(now) - 1)) / len(now)
    for index, one in enumerate(control.sliders):
        if index:
            imgui.same_line(0.0, spacing)
        imgui.set_next_item_width(width)
        now[index] = _number(f"##{control.key}.{index}", one, now[index], "")
    return now


def _number(name: str, of: Slider, now: float, unit: str) -> float:
    """A slider, which takes numbers beyond its ends by Ctrl and a click."""

    def words(value: float) -> str:
        digits = f"{value:.0f}" if of.whole or value >= 10**DIGITS else f"{value:.{DIGITS}g}"
        return f"{digits} {unit}".rstrip()

    chosen = slider(
        name,
        int(now) if of.whole else float(now),
        (of.low, of.high),
        words,
        logarithmic=of.logarithmic,
        clamped=False,
    )
    if chosen is None:
        return now
    return int(chosen) if of.whole else float(f"{chosen:.{DIGITS}g}")
