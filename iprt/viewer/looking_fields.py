"""Fields of the range of displayed values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from iprt.viewer.controls import Slider
from iprt.viewer.fields import Field
from iprt.viewer.labels import PARTS
from iprt.viewer.lens import BUFFERS
from iprt.viewer.ui_state import UiState


def range_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the lowest and highest value of false colors, where they may be chosen."""

    def field(key: str) -> Field:
        def read() -> float:
            found = ui.distribution if scaled() else None
            return 0.0 if found is None else float(f"{getattr(found, key):.4g}")

        def write(value: float) -> None:
            change: dict[str, Any] = {key: max(float(value), 0.0)}
            ui.viewport.lens = replace(ui.viewport.lens, **change)

        def scaled() -> bool:
            name = None if ui.displayed is None else ui.displayed.buffer
            return name is not None and BUFFERS[name].scaled and ui.distribution is not None

        label, slider = PARTS[key], Slider(0.0, 1000.0, False, 0.01)
        return Field(
            key, "number", lambda: label, read, write, slider=slider, beyond=True, enabled=scaled
        )

    return field("low"), field("high")
