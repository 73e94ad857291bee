"""Declarative inputs of panels: label, and reading and writing of the value.

This module does not draw: `desktop.widgets.draw_field` and `web.inputs.Inputs` do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from iprt.viewer.controls import Slider
from iprt.viewer.labels import (
    CURVES,
    NOTHING,
    PARTS,
    PICTURE,
    PLAYBACK,
    TURNED,
    Label,
    comparisons,
)
from iprt.viewer.lens import BUFFERS
from iprt.viewer.object_states import ObjectState
from iprt.viewer.pose_parts import angles_of, moved, resized, turned
from iprt.viewer.ui_state import UiState
from iprt.viewer.viewport import MAX_FOV_DEG, MIN_FOV_DEG

Kind = Literal["switch", "choice", "number", "vector", "color", "file", "text", "line"]
NONE = Label("none", "")
SRGB = "Shown here as sRGB; scene.toml stores linear values"


@dataclass(frozen=True)
class Field:
    """An input of a panel.

    Attributes
    ----------
    key : str
        Key, unique in a window.
    kind : str
        Type of the value: bool; one of `options`; int or float; (x, y, z); linear (red, green,
        blue) in [0, 1]; a path as it is typed, empty for none; a text; a line of text, which is
        written when it is complete.
    label : callable
        Returns the current label.
    read, write : callable
        `write` may raise `IprtError`.
    options : callable
        Returns the labels of a choice by value.
    missing : callable
        Returns the reasons why values are not available now.
    slider : Slider or None
        Slider of a number.
    beyond : bool
        True if numbers beyond the slider's ends may be typed; `write` validates them.
    unit : str
    default : any
        Value of the reset button; None without one.
    enabled : callable
        Returns True if the input is usable now.
    """

    key: str
    kind: Kind
    label: Callable[[], Label]
    read: Callable[[], Any]
    write: Callable[[Any], object]
    options: Callable[[], Mapping[Any, Label]] = lambda: {}
    missing: Callable[[], Mapping[Any, str]] = lambda: {}
    slider: Slider | None = None
    beyond: bool = False
    unit: str = ""
    default: Any = None
    enabled: Callable[[], bool] = lambda: True

    @property
    def changed(self) -> bool:
        """True if the value is not the default."""
        return self.default is not None and self.read() != self.default

    def matches(self, words: str) -> bool:
        """Return True if key, label or tooltip contain all words of a search."""
        label = self.label()
        text = f"{self.key} {label.name} {label.about}".lower()
        return all(word in text for word in words.lower().split())


def view_field(ui: UiState) -> Field:
    """Build the choice of the scene's views, with an entry for any other view."""

    def options() -> Mapping[str, Label]:
        names = list(ui.engine.views)
        return {name: Label(name, "") for name in (*names, *([] if known() else [elsewhere()]))}

    def known() -> bool:
        return ui.viewport.name in ui.engine.views  # a reloaded scene may lack it

    def elsewhere() -> str:
        return "(panorama)" if ui.viewport.view.projection == "equirect" else TURNED

    def read() -> str:
        return ui.viewport.name or "" if known() else elsewhere()

    def write(name: str) -> None:
        if name in ui.engine.views:
            ui.go_to(name)

    return Field("view", "choice", lambda: PARTS["view"], read, write, options)


def look_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the view's direction and field of view."""

    def field(key: str, part: str, slider: Slider) -> Field:
        def write(value: float) -> None:
            value = min(max(float(value), slider.low), slider.high)
            change: dict[str, Any] = {part: value}
            ui.look(replace(ui.viewport.view, **change))

        def read() -> float:
            return round(float(getattr(ui.viewport.view, part)), 3)

        def perspective() -> bool:
            return ui.viewport.view.projection == "perspective"

        label = PARTS[key]
        return Field(
            key, "number", lambda: label, read, write, slider=slider, unit="°", enabled=perspective
        )

    return (
        field("yaw", "yaw_deg", Slider(-180.0, 180.0, False, 0.0)),
        field("pitch", "pitch_deg", Slider(-90.0, 90.0, False, 0.0)),
        field("fov", "fov_y_deg", Slider(MIN_FOV_DEG, MAX_FOV_DEG, False, 0.0)),
    )


def lens_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the lens."""

    def field(key: str, kind: Kind, part: str = "", **more: Any) -> Field:
        part = part or key

        def write(value: Any) -> None:
            change: dict[str, Any] = {part: value}
            if part == "buffer":
                change |= {"low": None, "high": None}
            ui.viewport.lens = replace(ui.viewport.lens, **change)

        return Field(
            key, kind, lambda: PARTS[key], lambda: getattr(ui.viewport.lens, part), write, **more
        )

    def compared() -> bool:
        return ui.viewport.lens.against is not None

    def missing() -> Mapping[Any, str]:
        problem = ui.viewport.truth_problem
        found = {ui.settings.method: "it is the method of the picture"}
        if problem is not None:
            found["truth"] = problem
        if ui.viewport.snapshot is None:
            found["snapshot"] = "none is taken yet (C)"
        return found

    buffers: dict[Any, Label] = {None: PICTURE, **BUFFERS}
    others: dict[Any, Label] = {None: NOTHING, **comparisons()}
    stops, share = Slider(-8.0, 8.0, False, 0.0), Slider(0.0, 1.0, False, 0.0)
    return (
        field("exposure", "number", "exposure_ev", slider=stops, unit="EV", default=0.0),
        field("curve", "choice", options=lambda: CURVES),
        field("buffer", "choice", options=lambda: buffers),
        field("against", "choice", options=lambda: others, missing=missing),
        field(
            "split",
            "number",
            slider=share,
            enabled=lambda: compared() and not ui.viewport.lens.error,
        ),
        field("error", "switch", enabled=compared),
    )


def place_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the selected object's pivot, rotation and size."""

    def position() -> tuple[float, ...]:
        return _rounded(np.zeros(3) if ui.state is None else ui.state.pivot, 4)

    def move(place: tuple[float, ...]) -> None:
        state = ui.state
        if state is not None:
            ui.selection.place(state, moved(state, place))

    def rotation() -> tuple[float, ...]:
        return _rounded(np.zeros(3) if ui.state is None else angles_of(ui.state), 3)

    def turn(angles: tuple[float, ...]) -> None:
        state = ui.state
        if state is not None and np.isfinite(angles).all():
            ui.selection.place(state, turned(state, angles))

    def size() -> float:
        return 1.0 if ui.state is None else round(float(ui.state.size.max()), 4)

    def resize(size: float) -> None:
        state = ui.state
        if state is not None and size > 0.0:
            ui.selection.place(state, resized(state, size))

    sizes = Slider(0.001, 1000.0, False, 0.01)
    return (
        Field("position", "vector", lambda: PARTS["position"], position, move, unit="m"),
        Field("rotation", "vector", lambda: PARTS["rotation"], rotation, turn, unit="°"),
        Field(
            "size",
            "number",
            lambda: PARTS["size"],
            size,
            resize,
            slider=sizes,
            unit="m",
            enabled=lambda: ui.state is not None and ui.state.light is None,
        ),
    )


def _rounded(values: ArrayLike, digits: int) -> tuple[float, ...]:
    """Return values without negative zeros."""
    return tuple(float(value) for value in np.asarray(values, np.float64).round(digits) + 0.0)


def selected_field(ui: UiState) -> Field:
    """Build the choice of the selected object."""

    def options() -> Mapping[Any, Label]:
        names = {state.name: Label(state.name, "") for state in ui.engine.objects}
        return {None: NONE, **names}

    def read() -> str | None:
        return ui.selected if ui.selected in options() else None

    label = PARTS["selected"]
    return Field(
        "selected", "choice", lambda: label, read, lambda n: setattr(ui, "selected", n), options
    )


def visibility_field(ui: UiState, state: ObjectState) -> Field:
    """Build the switch that shows an object in this window."""
    name = state.name
    about = "Show or hide it in this window." + (" Keyframes move it." if state.keyframed else "")
    return Field(
        name,
        "switch",
        lambda: Label(name, about),
        lambda: ui.visible(name),
        lambda on: ui.show([name], bool(on)),
    )


def playback_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the video's playback."""
    engine = ui.engine

    def switch(key: str, label: Label, read: Callable[[], bool], write: Any) -> Field:
        return Field(key, "switch", lambda: label, read, write)

    every, other = PLAYBACK["every frame"], PLAYBACK["real time"]
    return (
        switch(
            "play",
            Label(PARTS["play"].name, f"{PARTS['play'].about} Key: Space."),
            lambda: ui.playing,
            lambda on: engine.play() if on else engine.pause(),
        ),
        switch("loop", PARTS["loop"], lambda: engine.playback.loop, engine.set_loop),
        switch(
            "mode",
            Label(every.name, f"{every.about} Otherwise: {other.about}"),
            lambda: engine.playback.mode == "every frame",
            lambda on: engine.set_playback_mode("every frame" if on else "real time"),
        ),
        Field(
            "frame",
            "number",
            lambda: PARTS["frame"],
            lambda: ui.frame,
            engine.seek,
            slider=Slider(ui.frames[0], ui.frames[-1], True, 0.0),
        ),
    )


def attribute_switch(ui: UiState, key: str, attribute: str) -> Field:
    """Build a switch for an attribute of the interface's state, labelled by its key in `PARTS`."""
    return Field(
        key,
        "switch",
        lambda: PARTS[key],
        lambda: getattr(ui, attribute),
        lambda on: setattr(ui, attribute, on),
    )
