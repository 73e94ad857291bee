"""Inputs of the panel of light and reflections; see `iprt.viewer.fields`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from iprt.footage.sun import DISC_DEG
from iprt.footage.video.video_table import SunTable
from iprt.scene.light_edits import LightEdit, angles_of, towards
from iprt.viewer.controls import Slider
from iprt.viewer.fields import SRGB, Field, Kind
from iprt.viewer.labels import BY_HAND, PARTS, SUNS, Label
from iprt.viewer.ui_state import UiState

MOST_IRRADIANCE = 10000.0


def light_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the choices between found, declared and no light."""
    engine = ui.engine

    def switch(key: str, off: str) -> Field:
        def write(on: bool) -> None:
            choice: dict[str, Any] = {key: "auto" if on else off}
            engine.set_light(LightEdit(**choice))

        return Field(
            key, "switch", lambda: PARTS[key], lambda: getattr(engine.video, key) == "auto", write
        )

    def read() -> str:
        sun = engine.video.sun
        return BY_HAND if isinstance(sun, SunTable) else sun

    return (
        switch("gloss", "declared"),
        switch("sky", "none"),
        Field("sun", "choice", lambda: PARTS["sun"], read, ui.choose_sun, lambda: SUNS),
    )


def sun_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the sun; a changed one sets it by hand."""

    def there() -> bool:
        return ui.engine.sun is not None

    def field(key: str, kind: Kind, read: Callable[[], Any], write: Any, **more: Any) -> Field:
        more.setdefault("label", lambda: PARTS[key])
        return Field(key, kind, read=read, write=write, enabled=there, **more)

    def angle(index: int) -> float:
        return angles_of(ui.sun.direction.tolist())[index]

    def color() -> tuple[float, ...]:
        return tuple(part / strongest() for part in ui.sun.irradiance)

    def strongest() -> float:
        return max(ui.sun.irradiance)

    def colored(new: tuple[float, float, float]) -> None:
        most = max(new)
        ui.shine(irradiance=[part * strongest() / most if most else 0.0 for part in new])

    def words() -> Label:
        linear = ", ".join(f"{part:.3g}" for part in ui.sun.irradiance)
        return Label(f"{PARTS['sun_color'].name} (sRGB)", f"{SRGB}: irradiance = [{linear}].")

    degrees: Mapping[str, Any] = {"unit": "°"}
    return (
        field("arrow", "switch", lambda: ui.selection.sun, ui.select_sun),
        field(
            "sun_yaw",
            "number",
            lambda: round(angle(0), 1) + 0.0,
            lambda yaw: ui.shine(direction=towards(yaw, angle(1))),
            slider=Slider(-180.0, 180.0, False, 0.0),
            **degrees,
        ),
        field(
            "sun_pitch",
            "number",
            lambda: round(angle(1), 1) + 0.0,
            lambda pitch: ui.shine(direction=towards(angle(0), pitch)),
            slider=Slider(-90.0, 90.0, False, 0.0),
            **degrees,
        ),
        field(
            "irradiance",
            "number",
            lambda: float(f"{strongest():.3g}"),
            lambda most: ui.shine(irradiance=[most * part for part in color()]),
            slider=Slider(0.01, MOST_IRRADIANCE, False, 0.1),
            beyond=True,
        ),
        field("sun_color", "color", color, colored, label=words),
        field(
            "angle_deg",
            "number",
            lambda: ui.sun.angle_deg,
            lambda angle_deg: ui.shine(angle_deg=angle_deg),
            slider=Slider(0.05, 10.0, False, 0.05),
            default=DISC_DEG,
            **degrees,
        ),
    )
