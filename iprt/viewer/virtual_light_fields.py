"""Inputs of the selected light without geometry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, get_args

from iprt.errors import SceneError
from iprt.scene.light_tables import (
    LightTable,
    LightUnit,
    PointTable,
    SunUnit,
    checked_light,
    written_light,
)
from iprt.viewer.controls import Slider
from iprt.viewer.fields import Field, Kind
from iprt.viewer.labels import LIGHTS, PARTS, UNITS, Label
from iprt.viewer.ui_state import FIRST_LIGHT, UiState

KEPT = ("power", "color", "radius")
"""Keys that another kind of light takes over."""
MOST_POWER = 2000.0


def virtual_light_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the selected light."""

    def light() -> LightTable:
        state = ui.state
        return FIRST_LIGHT if state is None or state.light is None else state.light

    def change(values: dict[str, Any]) -> None:
        """Change keys, unless a value is out of range."""
        with suppress(SceneError):
            ui.shine_as(checked_light(written_light(light()) | values))

    def become(kind: str) -> None:
        """Change the kind of light, and keep what both kinds have."""
        kept = {key: getattr(light(), key, None) for key in KEPT}
        if kind not in ("point", "spot"):
            kept.pop("radius")
        known = {key: value for key, value in kept.items() if value is not None}
        with suppress(SceneError):
            ui.shine_as(checked_light({"power": 1.0} | known | {"kind": kind}))

    def units() -> Mapping[Any, Label]:
        return {unit: UNITS[unit] for unit in get_args(SunUnit if sun() else LightUnit)}

    def sun() -> bool:
        return light().kind == "sun"

    def has(key: str) -> Callable[[], bool]:
        return lambda: key in type(light()).model_fields

    def number(key: str, part: str, slider: Slider, index: int | None = None) -> Field:
        """Build the field of a number, or of one of a pair."""

        def read() -> float:
            value = getattr(light(), part, None)
            found = value if index is None or value is None else value[index]
            return 0.0 if found is None else float(f"{found:.4g}")

        def write(value: float) -> None:
            if index is None:
                change({part: float(value)})
            else:
                pair = list(getattr(light(), part))
                pair[index] = float(value)
                change({part: pair})

        return Field(
            key,
            "number",
            lambda: PARTS[key],
            read,
            write,
            slider=slider,
            beyond=True,
            enabled=has(part),
        )

    def simple(key: str, kind: Kind, read: Any, write: Any, **more: Any) -> Field:
        return Field(key, kind, lambda: PARTS[key], read, write, **more)

    half_angles, sides = Slider(0.0, 90.0, False, 0.0), Slider(0.01, 10.0, False, 0.01)
    return (
        simple("light", "choice", lambda: light().kind, become, options=lambda: LIGHTS),
        number("power", "power", Slider(0.0, MOST_POWER, False, 0.01)),
        simple(
            "unit",
            "choice",
            lambda: light().unit,
            lambda unit: change({"unit": unit}),
            options=units,
            enabled=lambda: not isinstance(light(), PointTable) or light().power is not None,
        ),
        simple(
            "light color",
            "color",
            lambda: tuple(min(part, 1.0) for part in light().color),
            lambda color: change({"color": [float(part) for part in color]}),
        ),
        number("radius", "radius", Slider(0.0, 1.0, False, 0.001)),
        number("inner", "cone_deg", half_angles, 0),
        number("outer", "cone_deg", half_angles, 1),
        number("width", "size", sides, 0),
        number("height", "size", sides, 1),
        number("diameter", "diameter_deg", Slider(0.0, 20.0, False, 0.0)),
    )
