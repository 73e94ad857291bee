"""Fields that arrange the selected objects: name, steps of gizmos, and copies along a line."""

from __future__ import annotations

from typing import Any

from iprt.viewer.controls import Slider
from iprt.viewer.fields import Field, Kind, attribute_switch
from iprt.viewer.labels import PARTS
from iprt.viewer.ui_state import UiState

MOST_COPIES = 100


def name_field(ui: UiState) -> Field:
    """Build the name of the primary object."""
    return Field(
        "name", "line", lambda: PARTS["name"], lambda: ui.selected or "", ui.selection.rename
    )


def group_field(ui: UiState) -> Field:
    """Build the switch that selects whole groups."""

    def write(on: bool) -> None:
        ui.selection.whole_groups = on
        ui.selection.select(*([] if ui.selected is None else [ui.selected]))

    return Field(
        "whole_groups",
        "switch",
        lambda: PARTS["whole_groups"],
        lambda: ui.selection.whole_groups,
        write,
    )


def step_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the steps in which gizmos move and turn."""
    return (
        attribute_switch(ui, "stepped", "stepped"),
        _attribute(ui, "step_m", "number", slider=Slider(0.005, 2.0, False, 0.01), unit="m"),
        _attribute(ui, "step_deg", "number", slider=Slider(1.0, 90.0, False, 0.0), unit="°"),
    )


def array_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of copies along a line."""
    return (
        _attribute(ui, "array_count", "number", slider=Slider(2, MOST_COPIES, True, 0.0)),
        _attribute(ui, "array_step", "vector", unit="m"),
    )


def _attribute(ui: UiState, key: str, kind: Kind, **more: Any) -> Field:
    return Field(
        key,
        kind,
        lambda: PARTS[key],
        lambda: getattr(ui, key),
        lambda value: setattr(ui, key, value),
        **more,
    )
