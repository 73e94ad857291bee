"""Fields of the renderer's settings, derived from their model."""

from __future__ import annotations

from collections.abc import Mapping

from iprt.settings.overrides import Setting, all_settings, groups
from iprt.settings.presets import PRESETS, Quality
from iprt.viewer.controls import (
    Slider,
    preset_of,
    slider_of,
    value_of,
    with_preset,
    with_value,
)
from iprt.viewer.fields import Field, Kind
from iprt.viewer.labels import PARTS, Label
from iprt.viewer.ui_state import UiState

OWN = "own"
"""Name in place of a preset if settings differ from all presets."""
MOST_FPS = 240


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
        ui.viewport.motion.target_fps = float(fps) if fps > 0 else None

    return Field(
        "fps",
        "number",
        lambda: PARTS["fps"],
        lambda: round(ui.viewport.motion.target_fps or 0.0),
        write,
        slider=Slider(0, MOST_FPS, True, 1.0),
    )


def setting_groups(ui: UiState) -> tuple[tuple[Label, tuple[Field, ...]], ...]:
    """Build the fields of all settings by group, in the order of the model."""
    by_group: dict[str, list[Field]] = {}
    for setting in all_settings().values():
        by_group.setdefault(setting.group, []).append(setting_field(ui, setting))
    abouts = {"": "Settings of all passes.", **groups()}
    return tuple(
        (Label((name or "general").replace("_", " "), abouts[name]), tuple(fields))
        for name, fields in by_group.items()
    )


def setting_field(ui: UiState, setting: Setting) -> Field:
    """Build the field of a renderer setting.

    Raises
    ------
    TypeError
        No field supports its type.
    """
    key, schema = setting.key, setting.schema
    options = {word: Label(word, "") for word in schema.get("enum", ())}
    kind = "choice" if options else _KINDS.get(schema.get("type"))
    if kind is None:
        raise TypeError(f"{key}: no field takes {setting.allowed}")
    name = key.rpartition(".")[2].replace("_", " ")
    label = Label(name, f"{setting.help} ({setting.allowed}; {key})")
    return Field(
        key,
        kind,
        lambda: label,
        lambda: value_of(ui.settings, key),
        lambda value: setattr(ui, "settings", with_value(ui.settings, key, value)),
        lambda: options,
        slider=slider_of(schema, setting.default) if kind == "number" else None,
        beyond=True,
        unit=str(schema.get("unit", "")),
        default=setting.default,
    )


_KINDS: Mapping[object, Kind] = {"boolean": "switch", "integer": "number", "number": "number"}
