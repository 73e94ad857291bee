"""Inputs of the selected object's material."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from iprt.geometry.material import MAX_ABSORPTION, MAX_EMISSION, Material
from iprt.scene.edit_writing import COLORS
from iprt.scene.material_maps import MAPS, MapName, read_map, with_maps
from iprt.viewer.controls import Slider
from iprt.viewer.fields import SRGB, Field, Kind
from iprt.viewer.labels import MATERIALS, PARTS, Label
from iprt.viewer.ui_state import UiState

MOST_EMISSION = 100.0
FILES = "Path of a picture, from the scene's folder; nothing removes it."
PLASTIC = Material("plastic")


def material_fields(ui: UiState) -> tuple[Field, ...]:
    """Build the fields of the selected object's material."""

    def material() -> Material:
        state = ui.state
        return PLASTIC if state is None or state.light is not None else state.materials[0]

    def color() -> Label:
        part = PARTS[COLORS.get(material().kind, "albedo")]
        texture = " It multiplies the texture." if material().texture is not None else ""
        linear = ", ".join(f"{value:.3g}" for value in material().albedo)
        return Label(f"{part.name} (sRGB)", f"{part.about}{texture} {SRGB}: {linear}.")

    def field(key: str, kind: Kind, part: str, **more: Any) -> Field:
        more.setdefault("label", lambda: PARTS[key])
        return Field(
            key,
            kind,
            read=lambda: getattr(material(), part),
            write=lambda value: ui.selection.paint(**{part: value}),
            **more,
        )

    def brightness() -> float:
        return float(f"{max(material().emission):.3g}")

    def shine(brightness: float) -> None:
        """Emit the color of the light, or the material's until there is one; white if black."""
        if not 0.0 <= brightness <= MAX_EMISSION:
            return
        own = material().emission if material().emits else material().albedo
        own = own if max(own) > 0.0 else (1.0, 1.0, 1.0)
        r, g, b = (brightness * part / max(own) for part in own)
        ui.selection.paint(emission=(r, g, b))

    def absorb(values: tuple[float, ...]) -> None:
        if all(0.0 <= value <= MAX_ABSORPTION for value in values):
            ui.selection.paint(absorption=tuple(map(float, values)))

    def map_field(key: MapName, **more: Any) -> Field:
        def label() -> Label:
            image, part = getattr(material(), key), PARTS[key]
            size = "" if image is None else f" ({image.shape[1]} x {image.shape[0]})"
            return Label(part.name + size, f"{part.about} {FILES}")

        def write(path: str) -> None:
            if ui.state is None:
                return
            maps = {name: getattr(material(), name) for name in MAPS}
            file = Path(path.strip()).expanduser()
            maps[key] = read_map(ui.engine.scene.root / file, key) if path.strip() else None
            given = {name: image for name, image in maps.items() if image is not None}
            none: dict[str, Any] = dict.fromkeys(MAPS)
            bare = replace(material(), **none)
            ui.engine.editor.paint({ui.state.name: with_maps(bare, given)})

        return Field(key, "file", label, lambda: "", write, **more)

    alphas, indices = Slider(0.0, 1.0, False, 0.0), Slider(1.01, 3.0, False, 0.0)
    rough, coated, mixed, coat, fibres, clear, solid, holed = (
        {"enabled": lambda: material().kind != "diffuse"},
        {"enabled": lambda: material().kind in ("plastic", "principled", "dielectric")},
        {"enabled": lambda: material().kind == "principled"},
        {"enabled": lambda: material().kind == "principled" and material().clearcoat > 0.0},
        {"enabled": lambda: material().kind == "principled" and max(material().sheen) > 0.0},
        {"enabled": lambda: material().transmits},
        {"enabled": lambda: material().transmits and not material().thin},
        {"enabled": lambda: material().opacity_texture is not None},
    )
    limits: dict[MapName, Any] = {"surface_texture": mixed, "clearcoat_normal_texture": coat}
    return (
        field("material", "choice", "kind", options=lambda: MATERIALS),
        field("color", "color", "albedo", label=color),
        field("alpha", "number", "alpha", slider=alphas, **rough),
        field("ior", "number", "ior", slider=indices, **coated),
        field("metallic", "number", "metallic", slider=alphas, **mixed),
        field("transmission", "number", "transmission", slider=alphas, **mixed),
        field("clearcoat", "number", "clearcoat", slider=alphas, **mixed),
        field("clearcoat_alpha", "number", "clearcoat_alpha", slider=alphas, **coat),
        field("sheen", "color", "sheen", **mixed),
        field("sheen_alpha", "number", "sheen_alpha", slider=alphas, **fibres),
        field("tint", "color", "tint", **mixed),
        field("thin", "switch", "thin", **clear),
        Field(
            "absorption",
            "vector",
            lambda: PARTS["absorption"],
            lambda: material().absorption,
            absorb,
            unit="1/m",
            enabled=solid["enabled"],
        ),
        field("priority", "number", "priority", slider=Slider(-9, 9, True, 0.0), **solid),
        field("opacity", "number", "opacity", slider=alphas),
        field("cutoff", "number", "cutoff", slider=alphas, **holed),
        *(map_field(key, **limits.get(key, {})) for key in MAPS),
        Field(
            "emission",
            "number",
            lambda: PARTS["emission"],
            brightness,
            shine,
            slider=Slider(0.0, MOST_EMISSION, False, 0.1),
            beyond=True,
        ),
    )
