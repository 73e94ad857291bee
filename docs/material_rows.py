"""Rows of docs/materials.md: parameters of materials, with the values that are shown."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import Material
from iprt.scene.material_tables import MaterialTable

RED, GREEN, GOLD, WHITE = (0.55, 0.06, 0.04), (0.05, 0.3, 0.08), (0.95, 0.73, 0.38), (1.0, 1.0, 1.0)


@cache
def schemas() -> dict[str, dict[str, Any]]:
    """Return the properties of each kind of material in scene.toml, by name."""
    kinds = get_args(get_args(MaterialTable)[0])
    found = {}
    for table in kinds:
        properties = table.model_json_schema()["properties"]
        found[properties.pop("kind")["const"]] = properties
    return found


@dataclass(frozen=True)
class Row:
    """A parameter, and materials that have several of its values."""

    name: str
    meaning: str
    materials: tuple[Material, ...] = ()
    gltf: str = ""

    @property
    def values(self) -> str:
        """Say which kinds have the parameter, within which bounds, and its default."""
        kinds = {kind: table[self.name] for kind, table in schemas().items() if self.name in table}
        some = next(iter(kinds.values()))
        bounds = some.get("items", some)
        low = bounds.get("minimum", bounds.get("exclusiveMinimum"))
        said = "" if low is None else f"; {low:g} to {bounds['maximum']:,.0f}"
        if "minItems" in some:
            said += ", red, green and blue"
        defaults = {table["default"] for table in map(_hashable, kinds.values())} - {None}
        if defaults:
            said += "; default " + " or ".join(sorted(defaults))
        return ", ".join(f"`{kind}`" for kind in kinds) + said

    def markdown(self, scores: str) -> str:
        """Return the row of the table; `scores` is empty without a picture."""
        picture = f"![{self.name}](materials/{self.name}.jpg)" if scores else ""
        gltf = f" glTF: {self.gltf}." if self.gltf else ""
        return f"| `{self.name}` | {self.meaning}{gltf} *{self.values}.* | {picture} | {scores} |"


def _hashable(table: dict[str, Any]) -> dict[str, str | None]:
    default = table.get("default")
    return {"default": None if default is None else f"{default}".lower()}


def varied(material: Material, name: str, *values: Any) -> tuple[Material, ...]:
    """Return a material with each value of a parameter."""
    return tuple(replace(material, **{name: value}) for value in values)


def checks(count: int, first: Any, second: Any) -> NDArray[np.float32]:
    """Return a checkered texture of two values, with 16 texels for each check."""
    rows, columns = np.indices((16 * count, 32 * count)) // 16
    chosen = ((rows + columns) % 2)[..., None]
    values = np.where(chosen, np.float32(first), np.float32(second))
    return np.asarray(values, np.float32)


def ripples() -> NDArray[np.float32]:
    """Return a normal map of rings about the ball's axis."""
    slope = 0.5 * np.sin(np.arange(256) / 256.0 * 24.0 * 2.0 * np.pi)
    vectors = np.stack([np.zeros(256), slope, np.ones(256)], axis=-1)
    vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.repeat(vectors[:, None], 16, axis=1), np.float32)


PLASTIC = Material("plastic", RED, 0.08)
METAL = Material("conductor", GOLD, 0.15)
MIXED = Material("principled", RED, 0.25)
GLASS = Material("dielectric", WHITE, 0.0)
ROWS = (
    Row(
        "albedo",
        "Color of the light that is reflected diffusely, and of a metal's share.",
        tuple(Material("diffuse", color) for color in ((0.05,) * 3, RED, (0.9,) * 3)),
        "`baseColorFactor`",
    ),
    Row(
        "reflectance",
        "Color of a metal's reflection. It is the same in all directions.",
        (replace(METAL, albedo=(0.3,) * 3), METAL, replace(METAL, albedo=(0.95,) * 3)),
    ),
    Row(
        "transmittance",
        "Share of light that each surface of the glass lets pass.",
        (GLASS, replace(GLASS, albedo=(0.9, 0.95, 0.5)), replace(GLASS, albedo=(0.3, 0.5, 0.9))),
        "`baseColorFactor`, with `transmissionFactor` 1",
    ),
    Row(
        "alpha",
        "GGX roughness of the reflection: 0 is polished, 1 is dull.",
        (*varied(PLASTIC, "alpha", 0.0, 0.1, 0.4), *varied(METAL, "alpha", 0.0, 0.1, 0.4)),
        "the square of `roughnessFactor`",
    ),
    Row(
        "ior",
        "Index of refraction of the coat or the glass.",
        (*varied(PLASTIC, "ior", 1.2, 1.5, 2.4), *varied(GLASS, "ior", 1.2, 1.5, 2.4)),
        "KHR_materials_ior, and `specularFactor`",
    ),
    Row(
        "metallic",
        "Share of metal; the rest is plastic.",
        varied(replace(MIXED, albedo=GOLD), "metallic", 0.0, 0.5, 1.0),
        "`metallicFactor`",
    ),
    Row(
        "transmission",
        "Share of light below the coat that passes, as through glass.",
        varied(replace(MIXED, albedo=GOLD, alpha=0.02), "transmission", 0.2, 0.6, 1.0),
        "`transmissionFactor`",
    ),
    Row(
        "thin",
        "A wall without inside: light goes straight on.",
        varied(GLASS, "thin", False, True),
        "no `thicknessFactor`",
    ),
    Row(
        "absorption",
        "Of light inside of the glass, 1/m.",
        varied(GLASS, "absorption", (0.0, 2.0, 4.0), (2.0, 8.0, 16.0), (40.0, 10.0, 20.0)),
        "`attenuationColor`, `attenuationDistance`",
    ),
    Row("priority", "Where solids of glass overlap, the one of the highest priority fills space."),
    Row(
        "clearcoat",
        "Strength of a clear coat, of index of refraction 1.5.",
        varied(
            replace(MIXED, metallic=1.0, alpha=0.3, clearcoat_alpha=0.02),
            "clearcoat",
            0.0,
            0.5,
            1.0,
        ),
        "`clearcoatFactor`",
    ),
    Row(
        "clearcoat_alpha",
        "GGX roughness of the clear coat.",
        varied(
            replace(MIXED, metallic=1.0, alpha=0.3, clearcoat=1.0),
            "clearcoat_alpha",
            0.02,
            0.1,
            0.4,
        ),
        "the square of `clearcoatRoughnessFactor`",
    ),
    Row(
        "sheen",
        "Color of fibres, which reflect light at grazing angles.",
        varied(
            replace(MIXED, albedo=(0.05, 0.02, 0.1), alpha=0.8),
            "sheen",
            (0.3,) * 3,
            (0.2, 0.2, 0.9),
            WHITE,
        ),
        "`sheenColorFactor`",
    ),
    Row(
        "sheen_alpha",
        "Roughness of the sheen: small values keep to the edges.",
        varied(
            replace(MIXED, albedo=(0.05, 0.02, 0.1), alpha=0.8, sheen=(0.2, 0.2, 0.9)),
            "sheen_alpha",
            0.02,
            0.25,
            1.0,
        ),
        "the square of `sheenRoughnessFactor`",
    ),
    Row(
        "tint",
        "Color of the plastic's reflection where light comes from the viewer. It is white at "
        "grazing angles.",
        varied(
            replace(MIXED, alpha=0.05, ior=1.8), "tint", WHITE, (0.1, 0.4, 1.0), (1.0, 0.3, 0.05)
        ),
        "`specularColorFactor`",
    ),
    Row(
        "emission",
        "Radiance that the surface emits in all directions. 1 is the white of the video.",
        varied(
            Material("diffuse", (0.5,) * 3),
            "emission",
            (0.1, 0.07, 0.03),
            (0.4, 0.28, 0.12),
            (2.0, 1.4, 0.6),
        ),
        "`emissiveFactor`, KHR_materials_emissive_strength",
    ),
    Row(
        "opacity",
        "Share of the rays that meet the surface.",
        varied(PLASTIC, "opacity", 0.8, 0.5, 0.2),
        "alpha of `baseColorFactor`, with alphaMode `BLEND`",
    ),
    Row(
        "cutoff",
        "Opacity from which all rays meet the surface. Below it, none do.",
        (
            replace(
                Material("diffuse", GREEN),
                texture=checks(6, WHITE, WHITE),
                opacity_texture=checks(6, (1.0,), (0.0,))[..., 0],
                cutoff=0.5,
            ),
        ),
        "`alphaCutoff`, with alphaMode `MASK`",
    ),
    Row(
        "texture",
        "Picture that the albedo multiplies.",
        (replace(PLASTIC, albedo=WHITE, texture=checks(6, RED, (0.8, 0.75, 0.6))),),
        "`baseColorTexture`",
    ),
    Row(
        "surface_texture",
        "Map of metalness and of the root of alpha.",
        (replace(MIXED, albedo=GOLD, metallic=1.0, surface_texture=checks(6, (1, 1), (0, 1))),),
        "`metallicRoughnessTexture`",
    ),
    Row(
        "normal_texture",
        "Map of the normal along tangent, bitangent and normal.",
        (replace(PLASTIC, normal_texture=ripples()), replace(METAL, normal_texture=ripples())),
        "`normalTexture`",
    ),
    Row(
        "clearcoat_normal_texture",
        "The same of the clear coat, which is even without it, whatever lies below.",
        (
            replace(MIXED, clearcoat=1.0, normal_texture=ripples()),
            replace(MIXED, clearcoat=1.0, clearcoat_normal_texture=ripples()),
        ),
        "`clearcoatNormalTexture`",
    ),
    Row(
        "emission_texture",
        "Map that the emission multiplies.",
        (
            replace(
                Material("diffuse", (0.2,) * 3),
                emission=(1.0, 0.7, 0.3),
                emission_texture=checks(6, WHITE, (0.0,) * 3),
            ),
        ),
        "`emissiveTexture`",
    ),
)
