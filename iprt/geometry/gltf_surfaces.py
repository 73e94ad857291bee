"""Data model of the materials of a glTF document and of their textures.

Specification: Khronos glTF 2.0, section 3.9, and its extensions KHR_materials_*.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field

from iprt.geometry.gltf_part import Index, Number, Pair, Part, Quadruple, Triple, extension
from iprt.geometry.place import ALL_ALIKE, IDENTITY, Coefficients, Place, Places, relative, upright

UV_SETS = 2
"""Number of sets of texture coordinates that are read."""
Placement = tuple[int, Coefficients]
"""Set of texture coordinates, and the map of its coordinates, v down."""


class TextureTransform(Part):
    """A transform of texture coordinates (KHR_texture_transform)."""

    offset: Pair = Field(default=[0.0, 0.0])
    rotation: Number = 0.0
    scale: Pair = Field(default=[1.0, 1.0])
    tex_coord: Index | None = None

    @property
    def matrix(self) -> Coefficients:
        """Rows of the (2, 3) map of texture coordinates, v down.

        A positive rotation turns coordinates counter-clockwise as an image shows them.
        """
        c, s = float(np.cos(self.rotation)), float(np.sin(self.rotation))
        (x, y), (right, down) = self.scale, self.offset
        return (c * x, s * y, right), (-s * x, c * y, down)


class TextureReference(Part):
    """A material's reference to a texture."""

    index: Index
    tex_coord: Index = 0
    transform: TextureTransform | None = extension("KHR_texture_transform")

    @property
    def coordinates(self) -> int:
        """Index of the texture coordinate set."""
        given = None if self.transform is None else self.transform.tex_coord
        return self.tex_coord if given is None else given

    @property
    def placement(self) -> Placement:
        """Coordinate set and transform of the texture; the first set stands for unread ones."""
        number = self.coordinates if self.coordinates < UV_SETS else 0
        return number, IDENTITY if self.transform is None else self.transform.matrix


class NormalTexture(TextureReference):
    """A material's reference to a normal map."""

    scale: Number = 1.0


class PbrMetallicRoughness(Part):
    """The metallic-roughness parameters of a material."""

    base_color_factor: Quadruple = Field(default=[1.0, 1.0, 1.0, 1.0])
    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    base_color_texture: TextureReference | None = None
    metallic_roughness_texture: TextureReference | None = None


class SpecularGlossiness(Part):
    """The specular-glossiness parameters of a material that are read."""

    diffuse_factor: Quadruple = Field(default=[1.0, 1.0, 1.0, 1.0])
    glossiness_factor: Number = 1.0
    diffuse_texture: TextureReference | None = None


class EmissiveStrength(Part):
    """The factor of a material's emission."""

    emissive_strength: Number = 1.0


class IndexOfRefraction(Part):
    """The index of refraction of a material."""

    ior: Number = 1.5


class Specular(Part):
    """The strength of a dielectric's reflection."""

    specular_factor: Number = 1.0
    specular_color_factor: Triple = Field(default=[1.0, 1.0, 1.0])
    specular_texture: TextureReference | None = None
    specular_color_texture: TextureReference | None = None


class Transmission(Part):
    """The share of light that a surface transmits."""

    transmission_factor: Number = 0.0
    transmission_texture: TextureReference | None = None


class Volume(Part):
    """The inside of a material; a thickness other than 0 makes it a solid."""

    thickness_factor: Number = 0.0
    attenuation_distance: Number | None = None
    attenuation_color: Triple = Field(default=[1.0, 1.0, 1.0])


class Clearcoat(Part):
    """A clear coat."""

    clearcoat_factor: Number = 0.0
    clearcoat_texture: TextureReference | None = None
    clearcoat_roughness_factor: Number = 0.0
    clearcoat_roughness_texture: TextureReference | None = None
    clearcoat_normal_texture: NormalTexture | None = None


class Sheen(Part):
    """Light that fibres reflect at grazing angles."""

    sheen_color_factor: Triple = Field(default=[0.0, 0.0, 0.0])
    sheen_color_texture: TextureReference | None = None
    sheen_roughness_factor: Number = 0.0
    sheen_roughness_texture: TextureReference | None = None


class GltfMaterial(Part):
    """A material."""

    name: str | None = None
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: Number = 0.5
    emissive_factor: Triple = Field(default=[0.0, 0.0, 0.0])
    normal_texture: NormalTexture | None = None
    occlusion_texture: Any = None
    emissive_texture: TextureReference | None = None
    pbr_metallic_roughness: PbrMetallicRoughness = Field(default=PbrMetallicRoughness())
    glossiness: SpecularGlossiness | None = extension("KHR_materials_pbrSpecularGlossiness")
    strength: EmissiveStrength | None = extension("KHR_materials_emissive_strength")
    refraction: IndexOfRefraction | None = extension("KHR_materials_ior")
    specular: Specular | None = extension("KHR_materials_specular")
    transmission: Transmission | None = extension("KHR_materials_transmission")
    volume: Volume | None = extension("KHR_materials_volume")
    clearcoat: Clearcoat | None = extension("KHR_materials_clearcoat")
    sheen: Sheen | None = extension("KHR_materials_sheen")
    unlit: Any = extension("KHR_materials_unlit")

    @property
    def has_opacity(self) -> bool:
        """True if alpha makes holes."""
        return self.alpha_mode in ("MASK", "BLEND")

    def color_textures(self) -> list[TextureReference]:
        """Return the color textures of this material."""
        other = None if self.glossiness is None else self.glossiness.diffuse_texture
        given = [self.pbr_metallic_roughness.base_color_texture, other]
        return [texture for texture in given if texture is not None]

    def textures(self) -> list[TextureReference]:
        """Return the textures of this material that are read."""
        surface = None
        if self.glossiness is None:
            surface = self.pbr_metallic_roughness.metallic_roughness_texture
        glow = self.emissive_texture if max(self.emissive_factor) > 0.0 else None
        others = [surface, self.normal_texture, glow]
        if self.unlit is not None:
            return self.color_textures()[:1]
        read = [one for one in others if one is not None]
        coat = [one for one in (self.coat_normal_texture,) if one is not None]
        return self.color_textures()[:1] + read + list(self.varying().values()) + coat

    @property
    def coat_normal_texture(self) -> NormalTexture | None:
        """The normal map of the clear coat, if there is one."""
        coat = self.clearcoat
        if coat is None or self.unlit is not None or not coat.clearcoat_factor > 0.0:
            return None
        return coat.clearcoat_normal_texture

    def varying(self) -> dict[str, TextureReference]:
        """Return the textures of parameters that kernels read by the index of a material.

        Keys are the keys of `gltf_layers.CHANNELS`. Textures without effect are left out.
        """
        coat, sheen, specular, passing = (
            self.clearcoat,
            self.sheen,
            self.specular,
            self.transmission,
        )
        given: dict[str, TextureReference | None] = {}
        if coat is not None and coat.clearcoat_factor > 0.0:
            given["clearcoat"] = coat.clearcoat_texture
            given["clearcoat roughness"] = coat.clearcoat_roughness_texture
        if sheen is not None and max(sheen.sheen_color_factor) > 0.0:
            given["sheen"] = sheen.sheen_color_texture
            given["sheen roughness"] = sheen.sheen_roughness_texture
        if specular is not None and specular.specular_factor > 0.0:
            given["specular"] = specular.specular_texture
            given["specular color"] = specular.specular_color_texture
        if passing is not None and passing.transmission_factor > 0.0:
            given["transmission"] = passing.transmission_texture
        return {name: one for name, one in given.items() if one is not None}

    @property
    def placement(self) -> Placement:
        """`TextureReference.placement` of the first texture that is read."""
        return next((one.placement for one in self.textures()), (0, IDENTITY))

    @property
    def places(self) -> Places:
        """`Material.places`, of meshes whose coordinates lie at `placement`."""
        if self.unlit is not None:
            return ALL_ALIKE
        surface = self.pbr_metallic_roughness.metallic_roughness_texture
        read = self.textures()
        used = surface, self.normal_texture, self.emissive_texture, self.coat_normal_texture
        first, second, third, fourth = (
            None if one is None or one not in read else _place(self.placement, one.placement)
            for one in used
        )
        return first, second, third, fourth

    @property
    def misplaced(self) -> bool:
        """True if some texture is read at the place of another."""
        base = self.placement
        layers = any(one.placement != base for one in self.varying().values())
        others = {one.placement for one in self.textures()} - {base}
        return layers or any(_place(base, other) is None for other in others)


def _place(base: Placement, other: Placement) -> Place | None:
    """Return the place of a texture on a mesh whose coordinates lie at `base`.

    None if it is the same, or if all coordinates there fall onto a line.
    """
    if other == base:
        return None
    if other[0] != base[0]:
        return Place(upright(other[1]), second=True)
    return relative(upright(base[1]), upright(other[1]))
