"""Inputs and buttons of a panel in the browser, built from their descriptions."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from iprt.errors import IprtError
from iprt.files.images import decode_srgb, srgb_encode
from iprt.viewer.actions import Action
from iprt.viewer.controls import Slider
from iprt.viewer.fields import Field
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.handles import do_on, show

Convert = Callable[[Any], Any]
HELD_S = 0.4
"""Seconds for which an input is not updated after its user has changed it."""
STEPS = 200
"""Number of steps of a non-integer slider."""
QUIET = (60, 66, 74)
"""Color (RGB) of buttons."""
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
    sparse : bool
        Hide disabled inputs.
    shown : callable
        Returns True if a field is shown.
    """

    def __init__(
        self,
        ui: BrowserState,
        rows: Iterable[Field | Action],
        *,
        visible: Callable[[], bool] = lambda: True,
        sparse: bool = False,
        shown: Callable[[Field], bool] = lambda _: True,
    ) -> None:
        self._ui, self._visible, self._sparse, self._shown = ui, visible, sparse, shown
        self._bound: list[Binding | Upload | Line] = []
        self._buttons: list[tuple[Action, Any]] = []
        self._maps: Any = None
        for row in rows:
            if isinstance(row, Action):
                self._add_button(row)
            elif row.kind == "file":
                self._add_upload(row)
            elif row.kind == "text":
                self._bound.append(Line(ui, row))
            else:
                self._bound.append(Binding(ui, row))

    @property
    def touched(self) -> bool:
        """True if the user changed an input recently and may still hold it."""
        return any(binding.touched for binding in self._bound)

    def sync(self) -> None:
        """Show changed values."""
        visible = self._visible()
        for action, button in self._buttons:
            show(button, "visible", visible and action.visible())
            show(button, "disabled", not action.enabled())
        if self._maps is not None:
            # viser does not hide the buttons themselves.
            show(self._maps, "visible", visible)
        for binding in self._bound:
            shown = visible and (binding.field.enabled() or not self._sparse)
            shown = shown and self._shown(binding.field)
            show(binding.handle, "visible", shown)
            if shown:
                binding.sync()

    def remove(self) -> None:
        """Remove the inputs, but not the buttons."""
        for binding in self._bound:
            binding.handle.remove()

    def _add_upload(self, row: Field) -> None:
        if self._maps is None:
            self._maps = self._ui.client.gui.add_folder("Maps", expand_by_default=False)
        with self._maps:
            self._bound.append(Upload(self._ui, row))

    def _add_button(self, action: Action) -> None:
        button = self._ui.client.gui.add_button(
            action.label.name,
            icon=ICONS.get(action.name),
            color=None if action.name == "save" else QUIET,
            hint=action.hint,
        )
        do_on(button.on_click, self._ui.post, action.act)
        self._buttons.append((action, button))


class Binding:
    """An input whose user's changes are written, and which shows other changes.

    Parameters
    ----------
    ui : BrowserState
    field : Field
    """

    def __init__(self, ui: BrowserState, field: Field) -> None:
        self._ui, self.field = ui, field
        self.handle, self._shown, self._typed = _input(ui, field)
        self._touched_s = -HELD_S
        self._seen = field.read()
        show(self.handle, "value", self._shown(self._seen))

        # This must be a coroutine: viser would call a plain function on another thread, after
        # `show`.
        async def changed(event: Any) -> None:
            if event.client_id is not None:  # else the change is our own
                self._touched_s = time.monotonic()
                ui.post(self, self._write)

        self.handle.on_update(changed)

    @property
    def touched(self) -> bool:
        """True if the user changed it recently and may still hold it."""
        return time.monotonic() - self._touched_s < 2.0 * HELD_S

    def sync(self) -> None:
        """Show the current state, but not another value while the user is changing it."""
        field, handle = self.field, self.handle
        show(handle, "disabled", not field.enabled())
        show(handle, "label", _name(field))
        about = field.label().about
        if field.kind == "choice":
            options = field.options()
            show(handle, "options", tuple(option.name for option in options.values()))
            chosen = options[field.read()]
            about += f" {chosen.name}: {chosen.about}" if chosen.about else ""
        show(handle, "hint", about)
        if time.monotonic() - self._touched_s < HELD_S:
            return
        now = field.read()
        if now != self._seen:
            self._seen = now
            show(handle, "value", self._shown(now))

    def _write(self) -> None:
        value = self._typed(self.handle.value)
        try:
            self.field.write(value)
        except IprtError as error:
            self._ui.say(str(error), bad=True)
            self._touched_s = -HELD_S
        self._seen = value


class Upload:
    """A button that uploads a picture, whose path is written to a field.

    Parameters
    ----------
    ui : BrowserState
    field : Field
    """

    touched = False

    def __init__(self, ui: BrowserState, field: Field) -> None:
        self.field = field
        self.handle = ui.client.gui.add_upload_button(
            _name(field), icon="photo", color=QUIET, mime_type="image/*,.exr,.hdr"
        )

        async def uploaded(event: Any) -> None:
            file = event.target.value
            ui.post(object(), lambda: field.write(str(ui.received(file.name, file.content))))

        self.handle.on_upload(uploaded)

    def sync(self) -> None:
        """Show the current label."""
        show(self.handle, "disabled", not self.field.enabled())
        show(self.handle, "label", _name(self.field))
        show(self.handle, "hint", self.field.label().about)


class Line:
    """A line of text that is written to a field when Enter is pressed.

    Parameters
    ----------
    ui : BrowserState
    field : Field
    """

    touched = False

    def __init__(self, ui: BrowserState, field: Field) -> None:
        self.field, self._seen = field, field.read()
        self.handle = form = ui.client.gui.add_form(None)
        with form:
            self._text = ui.client.gui.add_text(_name(field), self._seen, hint=field.label().about)

        async def entered(_event: Any) -> None:
            ui.post(self, lambda: field.write(self._text.value))

        form.on_submit(entered)

    def sync(self) -> None:
        """Show the field's value once it changes."""
        now = self.field.read()
        if now != self._seen:
            self._seen = now
            show(self._text, "value", now)


def _input(ui: BrowserState, field: Field) -> tuple[Any, Convert, Convert]:
    """Add an input; return its handle, and the conversions of values to and from the handle's."""
    gui, name, now = ui.client.gui, _name(field), field.read()
    if field.kind == "switch":
        return gui.add_checkbox(name, bool(now)), bool, bool
    if field.kind == "color":
        return gui.add_rgb(name, (128, 128, 128)), _srgb, _linear
    if field.kind == "vector":
        return gui.add_vector3(name, now, step=0.01), tuple, tuple
    if field.kind == "choice":

        def typed(chosen: str) -> Any:
            options = field.options().items()
            return next((v for v, option in options if option.name == chosen), field.read())

        names = [option.name for option in field.options().values()]
        return gui.add_dropdown(name, names), lambda value: field.options()[value].name, typed
    slider = field.slider
    assert slider is not None
    kind, step = int if slider.whole else float, _step(slider)
    low, high = kind(slider.low), kind(slider.high)
    if not slider.logarithmic and low <= now <= high:
        return gui.add_slider(name, low, high, step, kind(now)), kind, kind
    # viser's sliders are linear, and accept no values beyond their ends.
    ends = {} if field.beyond else {"min": low, "max": high}
    return gui.add_number(name, kind(now), step=step, **ends), kind, kind


def _name(field: Field) -> str:
    """Return the label with its unit, and a mark if the value is not the default."""
    name, mark = field.label().name, "• " if field.changed else ""
    return (
        f"{mark}{name}" if not field.unit or field.unit in name else f"{mark}{name}, {field.unit}"
    )


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
