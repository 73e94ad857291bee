"""Declarative inputs of panels: label, and reading and writing of the value.

This module does not draw: `desktop.widgets.draw_field` and `web.inputs.Inputs` do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from iprt.geometry.material import Material
from iprt.settings.model import Settings
from iprt.settings.presets import PRESETS, Quality
from iprt.viewer.controls import Control, Slider, preset_of, value_of, with_preset, with_value
from iprt.viewer.labels import (
    BUFFERS,
    CURVES,
    MATERIALS,
    NOTHING,
    PARTS,
    PICTURE,
    TURNED,
    Label,
    comparisons,
)
from iprt.viewer.ui_state import UiState

Kind = Literal["switch", "choice", "number", "numbers", "vector", "color"]
REQUIRED: Any = object()
OWN = "own"
"""Name in place of a preset if settings differ from all presets."""
MOST_FPS = 240
PLASTIC = Material("plastic")
SRGB = "Shown here as sRGB; scene.toml stores linear values"


@dataclass(frozen=True)
class Field:
    """An input of a panel.

    Attributes
    ----------
    key : str
        Key, unique in a window.
    kind : str
        Type of the value: bool; one of `options`; int or float; a list of numbers; (x, y, z);
        linear (red, green, blue) in [0, 1].
    label : callable
        Returns the current label.
    read, write : callable
        `write` may raise `IprtError`.
    options : callable
        Returns the labels of a choice by value.
    missing : callable
        Returns the reasons why values are not available now.
    sliders : tuple of Slider
        One for a number, or one for each number of a list.
    beyond : bool
        True if numbers beyond the sliders' ends may be typed; `write` validates them.
    unit : str
    default : any
        Value of the reset button; `REQUIRED` without one.
    start : any
        Initial value when an input that may be None gets a value.
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
    sliders: tuple[Slider, ...] = ()
    beyond: bool = False
    unit: str = ""
    default: Any = REQUIRED
    start: Any = REQUIRED
    enabled: Callable[[], bool] = lambda: True


def view_field(ui: UiState) -> Field:
    """Build the choice of the scene's views, with an entry for any other view."""

    def options() -> Mapping[str, Label]:
        names = list(ui.engine.scene.views)
        return {name: Label(name, "") for name in (*names, *([] if known() else [elsewhere()]))}

    def known() -> bool:
        return ui.viewport.name in ui.engine.scene.views  # a reloaded scene may lack it

    def elsewhere() -> str:
        return "(panorama)" if ui.viewport.view.projection == "equirect" else TURNED

    def read() -> str:
        return ui.viewport.name or "" if known() else elsewhere()

    def write(name: str) -> None:
        if name in ui.engine.scene.views:
            ui.go_to(name)

    return Field("view", "choice", lambda: PARTS["view"], read, write, options)


def lens_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the lens."""

    def field(key: str, kind: Kind, part: str = "", **more: Any) -> Field:
        part = part or key

        def write(value: Any) -> None:
            change: dict[str, Any] = {part: value}
            ui.viewport.lens = replace(ui.viewport.lens, **change)

        return Field(
            key, kind, lambda: PARTS[key], lambda: getattr(ui.viewport.lens, part), write, **more
        )

    def compared() -> bool:
        return ui.viewport.lens.against is not None

    def missing() -> Mapping[Any, str]:
        problem = ui.viewport.truth_problem
        shown = {ui.settings.method: "it is the method of the picture"}
        return shown if problem is None else {**shown, "truth": problem}

    buffers: dict[Any, Label] = {None: PICTURE, **BUFFERS}
    others: dict[Any, Label] = {None: NOTHING, **comparisons()}
    stops, share = (Slider(-8.0, 8.0, False, 0.0),), (Slider(0.0, 1.0, False, 0.0),)
    return (
        field("exposure", "number", "exposure_ev", sliders=stops, unit="EV", default=0.0),
        field("curve", "choice", options=lambda: CURVES),
        field("buffer", "choice", options=lambda: buffers),
        field("against", "choice", options=lambda: others, missing=missing),
        field(
            "split",
            "number",
            sliders=share,
            enabled=lambda: compared() and not ui.viewport.lens.error,
        ),
        field("error", "switch", enabled=compared),
    )


def place_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the selected object's position and size."""

    def position() -> tuple[float, ...]:
        state = ui.state
        matrix = np.eye(4) if state is None else state.to_world
        return tuple(round(float(value), 4) for value in matrix[:3, 3])

    def move(place: tuple[float, ...]) -> None:
        state = ui.state
        if state is not None:
            to_world = state.to_world.copy()
            to_world[:3, 3] = place
            ui.engine.place(state.name, state.placed(to_world))

    def size() -> float:
        return 1.0 if ui.state is None else round(float(ui.state.size.max()), 4)

    def resize(size: float) -> None:
        state = ui.state
        if state is None or not size > 0.0:
            return
        low, high = state.corners
        foot = np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
        to_world, factor = state.to_world.copy(), size / float(state.size.max())
        # Scale about the centre of the bottom, so that the object stays in place.
        to_world[:3, 3] += (1.0 - factor) * to_world[:3, :3] @ foot
        to_world[:3, :3] *= factor
        ui.engine.place(state.name, state.placed(to_world))

    sizes = (Slider(0.001, 1000.0, False, 0.01),)
    return (
        Field("position", "vector", lambda: PARTS["position"], position, move),
        Field("size", "number", lambda: PARTS["size"], size, resize, sliders=sizes),
    )


def material_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the selected object's material."""

    def material() -> Material:
        return PLASTIC if ui.state is None else ui.state.materials[0]

    def color() -> Label:
        part = PARTS["reflectance" if material().kind == "conductor" else "albedo"]
        texture = " It multiplies the texture." if material().texture is not None else ""
        linear = ", ".join(f"{value:.3g}" for value in material().albedo)
        return Label(f"{part.name} (sRGB)", f"{part.about}{texture} {SRGB}: {linear}.")

    def field(key: str, kind: Kind, part: str, **more: Any) -> Field:
        more.setdefault("label", lambda: PARTS[key])
        return Field(
            key,
            kind,
            read=lambda: getattr(material(), part),
            write=lambda value: ui.paint(**{part: value}),
            **more,
        )

    alphas, indices = (Slider(0.0, 1.0, False, 0.0),), (Slider(1.01, 3.0, False, 0.0),)
    rough, coated = (
        {"enabled": lambda: material().kind != "diffuse"},
        {"enabled": lambda: material().kind == "plastic"},
    )
    return (
        field("material", "choice", "kind", options=lambda: MATERIALS),
        field("color", "color", "albedo", label=color),
        field("alpha", "number", "alpha", sliders=alphas, **rough),
        field("ior", "number", "ior", sliders=indices, **coated),
    )


def quality_field(ui: UiState) -> Field:
    """Build the choice of a preset, with an entry for other settings."""

    def read() -> str:
        preset = preset_of(ui.settings)
        return OWN if preset.differing else preset.quality

    def write(name: Quality) -> None:
        if name in PRESETS:
            ui.settings = with_preset(ui.settings, name)

    def options() -> Mapping[str, Label]:
        return {name: Label(name, "") for name in (*PRESETS, *([OWN] if read() == OWN else []))}

    return Field("preset", "choice", lambda: PARTS["preset"], read, write, options)


def rate_field(ui: UiState) -> Field:
    """Build the field of the frame rate to hold during motion."""

    def write(fps: float) -> None:
        ui.viewport.target_fps = float(fps) if fps > 0 else None

    return Field(
        "fps",
        "number",
        lambda: PARTS["fps"],
        lambda: round(ui.viewport.target_fps or 0.0),
        write,
        sliders=(Slider(0, MOST_FPS, True, 1.0),),
    )


def setting_field(ui: UiState, control: Control) -> Field:
    """Build the field of a renderer setting."""
    key = control.key
    label = Label(control.label, f"{control.help} ({control.allowed}; {key})")
    options = {word: Label(word, "") for word in control.choices}
    return Field(
        key,
        "number" if control.kind == "integer" else control.kind,
        lambda: label,
        lambda: value_of(ui.settings, key),
        lambda value: setattr(ui, "settings", with_value(ui.settings, key, value)),
        lambda: options,
        sliders=control.sliders,
        beyond=True,
        unit=control.unit,
        default=value_of(Settings(), key),
        start=control.start if control.nullable else REQUIRED,
    )
