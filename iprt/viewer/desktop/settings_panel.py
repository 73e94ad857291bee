"""The panel of the renderer's settings, made from their model."""

from __future__ import annotations

from typing import Any

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.errors import IprtError
from iprt.presets import PRESETS
from iprt.settings import Settings
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
from iprt.viewer.desktop.desk import Desk
from iprt.viewer.desktop.widgets import button, choice, disabled, heading, hint, label, quiet

USUAL_FPS = 30.0
_UNSET = "automatic"
_LOGARITHMIC = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp


def draw(desk: Desk) -> None:
    """The whole panel."""
    settings = desk.settings
    _preset(desk, settings)
    _pace(desk)
    for group in control_groups():
        name = group.name or "general"
        if not imgui.collapsing_header(name.replace("_", " ")):
            hint(group.about)
            continue
        hint(group.about)
        for control in group.controls:
            _row(desk, settings, control)


def _preset(desk: Desk, settings: Settings) -> None:
    heading("Quality")
    preset, names = preset_of(settings), list(PRESETS)
    label("preset", "Sets the knobs that differ most in cost; all others keep what you set.")
    chosen = choice("##preset", names, names.index(preset.quality))
    if chosen is not None:
        desk.settings = with_preset(settings, names[chosen])
    if preset.differing:
        quiet(preset.text)
        label("")
        if button("all defaults", width=-1.0):
            desk.settings = Settings()


def _pace(desk: Desk) -> None:
    viewport = desk.viewport
    label(
        "frame rate",
        "Frames per second to hold while something moves. What that costs least is given up for "
        "it, as was measured: rays, filters, resolution. At rest nothing is.",
    )
    held = viewport.target_fps is not None
    changed, held = imgui.checkbox("##held", held)
    if changed:
        viewport.target_fps = USUAL_FPS if held else None
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    with disabled(not held):
        changed, fps = imgui.slider_float(
            "##fps", viewport.target_fps or USUAL_FPS, 1.0, 120.0, "%.0f fps", _LOGARITHMIC
        )
    if changed and held:
        viewport.target_fps = round(fps)


def _row(desk: Desk, settings: Settings, control: Control) -> None:
    now = value_of(settings, control.key)
    label(control.label, f"{control.help}\n\n{control.key}: {control.allowed}")
    differs = now != control.start and not (now is None and control.nullable)
    if differs or (control.nullable and now is not None):
        imgui.set_next_item_width(-1.6 * imgui.get_frame_height())
    value = _value(control, now)
    if differs or (control.nullable and now is not None):
        imgui.same_line()
        if button(f"{icons.ICON_FA_ROTATE_LEFT}##{control.key}", "Back to the default"):
            value = value_of(Settings(), control.key)
    if value != now:
        try:
            desk.settings = with_value(settings, control.key, value)
        except IprtError as error:
            desk.say(str(error), bad=True)


def _value(control: Control, now: Any) -> Any:
    """The control, drawn; its value, changed or not."""
    name = f"##{control.key}"
    if now is None:
        pressed = imgui.button(f"{_UNSET}{name}", imgui.ImVec2(-1.0, 0.0))
        return control.start if pressed else None
    if control.kind == "switch":
        return imgui.checkbox(name, now)[1]
    if control.kind == "choice":
        index = choice(name, control.choices, control.choices.index(now))
        return now if index is None else control.choices[index]
    if control.kind == "numbers":
        return _numbers(control, list(now))
    return _number(name, control.sliders[0], now, control.unit)


def _numbers(control: Control, now: list[float]) -> list[float]:
    style = imgui.get_style()
    spacing = style.item_inner_spacing.x
    width = (imgui.calc_item_width() - spacing * (len(now) - 1)) / len(now)
    for index, slider in enumerate(control.sliders):
        if index:
            imgui.same_line(0.0, spacing)
        imgui.set_next_item_width(width)
        now[index] = _number(f"##{control.key}.{index}", slider, now[index], "")
    return now


def _number(name: str, slider: Slider, now: float, unit: str) -> float:
    """A slider, which takes other numbers by Ctrl and a click."""
    flags = imgui.SliderFlags_.logarithmic if slider.logarithmic else 0
    unit = f" {unit}".rstrip().replace("%", "%%")
    if slider.whole:
        changed, whole = imgui.slider_int(
            name, int(now), int(slider.low), int(slider.high), f"%d{unit}", flags
        )
        return whole if changed else now
    changed, number = imgui.slider_float(name, now, slider.low, slider.high, f"%.4g{unit}", flags)
    return float(f"{number:.{DIGITS}g}") if changed else now
