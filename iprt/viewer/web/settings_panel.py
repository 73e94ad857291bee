"""Every setting of the renderer, as an input made from the settings' model."""

from __future__ import annotations

from html import escape
from typing import Any

from iprt.settings.presets import PRESETS
from iprt.viewer.controls import (
    Control,
    Slider,
    control_groups,
    preset_of,
    value_of,
    with_preset,
    with_value,
)
from iprt.viewer.labels import PARTS
from iprt.viewer.web.binding import Binding, show
from iprt.viewer.web.browser_api import BrowserApi

OWN = "own"
MOST_FPS = 240
STEPS = 200
"""Number of steps of a slider whose values are not whole numbers."""


class SettingsPanel:
    """Settings are those of all browsers. The window's thread uses the panel."""

    def __init__(self, browser: BrowserApi) -> None:
        self._browser, self._engine = browser, browser.engine
        self._gui = browser.client.gui
        self._bindings: list[Binding] = []
        self._shown: object = None
        preset = self._gui.add_dropdown(
            "Quality", (*PRESETS, OWN), hint="Settings that no preset sets stay as they are"
        )
        self._bind(preset, self._quality, self._go_to)
        self._about = self._gui.add_html("")
        fps = PARTS["fps"]
        rate = self._gui.add_number(
            fps.name,
            0,
            min=0,
            max=MOST_FPS,
            step=1,
            hint=f"{fps.about} In this window; 0: always at full quality.",
        )
        self._bind(rate, lambda: round(browser.viewport.target_fps or 0.0), self._hold)
        for group in control_groups():
            with self._gui.add_folder(group.name or "general", expand_by_default=False):
                for control in group.controls:
                    self._add(control)
        self.sync()

    def sync(self) -> None:
        settings = self._engine.world.settings
        if settings is self._shown and not any(binding.touched for binding in self._bindings):
            return
        self._shown = settings
        preset = preset_of(settings)
        show(self._about, "content", _differing(preset.text if preset.differing else ""))
        for binding in self._bindings:
            binding.sync()

    def _bind(self, handle: Any, read: Any, write: Any) -> None:
        browser = self._browser
        self._bindings.append(Binding(handle, read, write, browser.post, browser.tell))

    def _quality(self) -> str:
        preset = preset_of(self._engine.world.settings)
        return OWN if preset.differing else preset.quality

    def _go_to(self, quality: Any) -> None:
        if quality != OWN:
            self._engine.set_settings(with_preset(self._engine.world.settings, quality))

    def _hold(self, fps: int) -> None:
        self._browser.viewport.target_fps = float(fps) if fps > 0 else None

    def _get(self, key: str) -> Any:
        return value_of(self._engine.world.settings, key)

    def _set(self, key: str, value: Any) -> None:
        self._engine.set_settings(with_value(self._engine.world.settings, key, value))

    def _add(self, control: Control) -> None:
        """The input of a setting, and where it may have no value, a box that says so."""
        key, start = control.key, control.start

        def read() -> Any:
            value = self._get(key)
            return start if value is None else value

        if control.nullable:
            given = self._gui.add_checkbox(
                f"set {control.label}", False, hint=f"Else: none. {control.help}"
            )
            self._bind(
                given,
                lambda: self._get(key) is not None,
                lambda on: self._set(key, start if on else None),
            )
        add = {
            "switch": self._add_switch,
            "choice": self._add_choice,
            "integer": self._add_number,
            "number": self._add_number,
            "numbers": self._add_numbers,
        }[control.kind]
        add(control, read)

    def _add_switch(self, control: Control, read: Any) -> None:
        handle = self._gui.add_checkbox(control.label, bool(read()), hint=_hint(control))
        self._bind(handle, read, lambda on: self._set(control.key, bool(on)))

    def _add_choice(self, control: Control, read: Any) -> None:
        handle = self._gui.add_dropdown(
            control.label, control.choices, initial_value=read(), hint=_hint(control)
        )
        self._bind(handle, read, lambda choice: self._set(control.key, choice))

    def _add_number(self, control: Control, read: Any) -> None:
        slider, label = control.sliders[0], _label(control)
        kind = int if slider.whole else float
        if slider.logarithmic or not slider.low <= read() <= slider.high:
            # viser's sliders are linear, and take nothing beyond their ends.
            handle = self._gui.add_number(
                label, kind(read()), step=_step(slider), hint=_hint(control)
            )
        else:
            handle = self._gui.add_slider(
                label,
                kind(slider.low),
                kind(slider.high),
                _step(slider),
                kind(read()),
                hint=_hint(control),
            )
        self._bind(handle, lambda: kind(read()), lambda value: self._set(control.key, kind(value)))

    def _add_numbers(self, control: Control, read: Any) -> None:
        add = {2: self._gui.add_vector2, 3: self._gui.add_vector3}[len(control.sliders)]
        kinds = [int if slider.whole else float for slider in control.sliders]
        handle = add(
            _label(control),
            tuple(map(float, read())),
            step=float(_step(control.sliders[0])),
            hint=_hint(control),
        )

        def write(values: tuple[float, ...]) -> None:
            self._set(control.key, [kind(v) for kind, v in zip(kinds, values, strict=True)])

        self._bind(handle, lambda: tuple(map(float, read())), write)


def _differing(text: str) -> str:
    """As high whatever it says: the inputs below it stay where they are."""
    style = (
        "height:3em;line-height:1.5;font-size:.8em;margin:0 .8em;opacity:.7;overflow:hidden;"
        "overflow-wrap:anywhere"
    )
    return f"<div class='preset' style='{style}' title='{escape(text)}'>{escape(text)}</div>"


def _label(control: Control) -> str:
    told = not control.unit or control.unit in control.label
    return control.label if told else f"{control.label}, {control.unit}"


def _hint(control: Control) -> str:
    return f"{control.help} ({control.allowed}; {control.key})"


def _step(slider: Slider) -> float:
    """Between two positions of a slider."""
    if slider.whole:
        return 1
    if slider.logarithmic:
        return float(f"{slider.bend / 10.0:.1g}")
    return float(f"{(slider.high - slider.low) / STEPS:.1g}")
