"""Inputs and buttons of a panel in the browser, built from their descriptions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from iprt.files.images import decode_srgb
from iprt.output.display import srgb_encode
from iprt.viewer.actions import Action
from iprt.viewer.controls import Slider
from iprt.viewer.fields import REQUIRED, Field
from iprt.viewer.labels import Label
from iprt.viewer.web.binding import Binding, do_on, show
from iprt.viewer.web.browser_state import BrowserState

STEPS = 200
"""Number of steps of a non-integer slider."""
QUIET = (60, 66, 74)
"""Colour (RGB) of buttons."""
ICONS = {
    "undo": "arrow-back-up",
    "redo": "arrow-forward-up",
    "save": "device-floppy",
    "remove": "trash",
}


class Inputs:
    """A column of inputs and buttons that follow the state, for use by the window's thread.

    Parameters
    ----------
    ui : BrowserState
    rows : iterable of Field or Action
    visible : callable
        Returns True while the column is shown.
    """

    def __init__(
        self,
        ui: BrowserState,
        rows: Iterable[Field | Action],
        *,
        visible: Callable[[], bool] = lambda: True,
    ) -> None:
        self._ui, self._visible = ui, visible
        self._bound: list[tuple[Field, Binding]] = []
        self._buttons: list[tuple[Action, Any]] = []
        for row in rows:
            self._add_button(row) if isinstance(row, Action) else self._add(row)

    @property
    def touched(self) -> bool:
        """True if the user changed an input recently and may still hold it."""
        return any(binding.touched for _, binding in self._bound)

    def sync(self) -> None:
        """Show changed values."""
        visible = self._visible()
        for action, button in self._buttons:
            show(button, "visible", visible and action.visible())
            show(button, "disabled", not action.enabled())
        for field, binding in self._bound:
            handle = binding.handle
            show(handle, "visible", visible)
            if not visible:
                continue
            show(handle, "disabled", not field.enabled())
            show(handle, "label", _name(field))
            about = field.label().about
            if field.kind == "choice":
                options = field.options()
                show(handle, "options", tuple(option.name for option in options.values()))
                chosen = options[field.read()]
                about += f" {chosen.name}: {chosen.about}" if chosen.about else ""
            show(handle, "hint", about)
            binding.sync()

    def remove(self) -> None:
        """Remove the inputs, but not the buttons."""
        for _, binding in self._bound:
            binding.handle.remove()

    def _add(self, field: Field) -> None:
        """Add an input, with a check box if it may have no value."""
        if field.start is not REQUIRED:
            label = field.label()
            given = Field(
                f"set {field.key}",
                "switch",
                lambda: Label(f"set {label.name}", f"Else: none. {label.about}"),
                lambda: field.read() is not None,
                lambda on: field.write(field.start if on else None),
            )
            self._bind(given, self._switch(given), given.read, given.write)
        add = {
            "switch": self._add_switch,
            "choice": self._add_choice,
            "number": self._add_number,
            "numbers": self._add_numbers,
            "vector": self._add_numbers,
            "color": self._add_color,
        }[field.kind]
        add(field)

    def _add_button(self, action: Action) -> None:
        button = self._ui.client.gui.add_button(
            action.label.name,
            icon=ICONS.get(action.name),
            color=None if action.name == "save" else QUIET,
            hint=action.hint,
        )
        do_on(button.on_click, self._ui.post, action.act)
        self._buttons.append((action, button))

    def _bind(
        self,
        field: Field,
        handle: Any,
        read: Callable[[], Any],
        write: Callable[[Any], object],
    ) -> None:
        ui = self._ui
        binding = Binding(handle, read, write, ui.post, lambda text: ui.say(text, bad=True))
        self._bound.append((field, binding))

    def _switch(self, field: Field) -> Any:
        return self._ui.client.gui.add_checkbox(_name(field), bool(field.read()))

    def _add_switch(self, field: Field) -> None:
        self._bind(field, self._switch(field), lambda: bool(field.read()), field.write)

    def _add_choice(self, field: Field) -> None:
        names = [option.name for option in field.options().values()]
        handle = self._ui.client.gui.add_dropdown(_name(field), names)

        def write(name: str) -> None:
            for value, option in field.options().items():
                if option.name == name:
                    field.write(value)

        self._bind(field, handle, lambda: field.options()[_value(field)].name, write)

    def _add_number(self, field: Field) -> None:
        slider, gui, now = field.sliders[0], self._ui.client.gui, _value(field)
        kind, step = int if slider.whole else float, _step(slider)
        low, high = kind(slider.low), kind(slider.high)
        if slider.logarithmic or not low <= now <= high:
            # viser's sliders are linear, and accept no values beyond their ends.
            ends = {} if field.beyond else {"min": low, "max": high}
            handle = gui.add_number(_name(field), kind(now), step=step, **ends)
        else:
            handle = gui.add_slider(_name(field), low, high, step, kind(now))
        self._bind(
            field, handle, lambda: kind(_value(field)), lambda value: field.write(kind(value))
        )

    def _add_numbers(self, field: Field) -> None:
        now, gui = tuple(map(float, _value(field))), self._ui.client.gui
        step = float(_step(field.sliders[0])) if field.sliders else 0.01
        add = {2: gui.add_vector2, 3: gui.add_vector3}[len(now)]
        kinds = [int if slider.whole else float for slider in field.sliders] or [float] * len(now)
        self._bind(
            field,
            add(_name(field), now, step=step),
            lambda: tuple(map(float, _value(field))),
            lambda new: field.write([kind(v) for kind, v in zip(kinds, new, strict=True)]),
        )

    def _add_color(self, field: Field) -> None:
        handle = self._ui.client.gui.add_rgb(_name(field), (128, 128, 128))
        self._bind(
            field, handle, lambda: _srgb(field.read()), lambda rgb: field.write(_linear(rgb))
        )


def _value(field: Field) -> Any:
    value = field.read()
    return field.start if value is None and field.start is not REQUIRED else value


def _name(field: Field) -> str:
    name = field.label().name
    return name if not field.unit or field.unit in name else f"{name}, {field.unit}"


def _step(slider: Slider) -> float:
    """Return the distance between two positions of a slider."""
    if slider.whole:
        return 1
    if slider.logarithmic:
        return float(f"{slider.bend / 10.0:.1g}")
    return float(f"{(slider.high - slider.low) / STEPS:.1g}")


def _srgb(linear: tuple[float, float, float]) -> tuple[int, ...]:
    levels = np.rint(255.0 * srgb_encode(np.clip(np.array(linear), 0.0, 1.0)))
    return tuple(int(level) for level in levels)


def _linear(rgb: tuple[int, ...]) -> tuple[float, float, float]:
    red, green, blue = decode_srgb(np.array([[rgb]], np.uint8))[0, 0]
    return float(red), float(green), float(blue)
