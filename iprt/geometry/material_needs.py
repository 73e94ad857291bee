"""Features of kernels and shaders that only some materials need."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from iprt.geometry.material import NORMAL_MAPS, Material


@dataclass(frozen=True)
class MaterialNeeds:
    """Features of materials that only some kernels and shaders have.

    Attributes
    ----------
    principled : bool
        Some material is principled.
    normal_maps : bool
        Some material has a normal map, maybe of its clear coat.
    holes : bool
        Some material lets rays pass.
    emission : bool
        Some material emits light.
    glass : bool
        Some material transmits light.
    covered : bool
        Some material has a clear coat, sheen or a tint.
    coat_normals : bool
        Some material has a clear coat with a normal of its own.
    textures : bool
        Some material has a texture.
    variants : bool
        Some material has variants.
    texture_places : bool
        Some material has a map that lies elsewhere.
    """

    principled: bool
    normal_maps: bool
    holes: bool
    emission: bool
    glass: bool
    covered: bool
    coat_normals: bool
    textures: bool
    variants: bool
    texture_places: bool

    @classmethod
    def of(cls, materials: Iterable[Material]) -> MaterialNeeds:
        """Return the needs of the materials of all objects."""
        every = list(materials)
        return cls(
            principled=any(material.kind == "principled" for material in every),
            normal_maps=any(one.maps[at] is not None for one in every for at in NORMAL_MAPS),
            holes=any(material.has_holes for material in every),
            emission=any(material.emits for material in every),
            glass=any(material.transmits for material in every),
            covered=any(material.is_covered for material in every),
            coat_normals=any(material.has_coat_normal for material in every),
            textures=any(material.textured for material in every),
            variants=any(material.palette for material in every),
            texture_places=any(any(material.map_places) for material in every),
        )

    @property
    def display_images(self) -> int:
        """Number of images of the drawn objects (`cl/lib/gbuffer/display.h`)."""
        return 5 if self.emission else 4 if self.principled else 3

    def defines(self) -> dict[str, bool]:
        """Return `-D` defines of kernels that read the materials."""
        return {
            "PRINCIPLED": self.principled,
            "NORMAL_MAPS": self.normal_maps,
            "HOLES": self.holes,
            "EMISSION": self.emission,
            "GLASS": self.glass,
            "COVERED": self.covered,
            "COAT_NORMALS": self.coat_normals,
            "TEXTURES": self.textures,
            "VARIANTS": self.variants,
            "TEXTURE_PLACES": self.texture_places,
        }
