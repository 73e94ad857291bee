"""Materials of virtual objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from iprt.device.kept import Arrays, kept
from iprt.device.kernel_source import constant, float_constant
from iprt.geometry.coat import internal_reflectance, rough_transmittance
from iprt.geometry.cover import MIN_SHEEN_ALPHA, clearcoat_table, sheen_table
from iprt.geometry.place import ALL_ALIKE, Place, Places
from iprt.geometry.sampler import ALL_PLAIN, Samplers
from iprt.geometry.variants import Variants

MaterialKind = Literal["diffuse", "conductor", "plastic", "principled", "dielectric"]
MIRROR_ALPHA = 1e-4
"""GGX roughness below which a surface is a perfect mirror."""
MAX_EMISSION = 1e6
"""Upper limit of emitted radiance."""
MAX_ABSORPTION = 1e6
"""Upper limit of absorption, in 1/m."""
_TABLE = "lib/world/material.h"
MIN_ALPHA = float_constant(_TABLE, "MIN_ALPHA")
MATERIAL_ROWS = constant(_TABLE, "MATERIAL_ROWS")
"""float4 rows per material in the table; `cl/lib/world/material.h` documents them."""
_FINISH_ROW, _MEDIUM_ROW = constant(_TABLE, "FINISH_ROW"), constant(_TABLE, "MEDIUM_ROW")
_COVER_ROW = constant("lib/world/cover.h", "COVER_ROW")
_NODES = constant(_TABLE, "MATERIAL_NODES")
_KINDS = {kind: constant(_TABLE, f"KIND_{kind.upper()}") for kind in get_args(MaterialKind)}

COAT_LEVELS = constant(_TABLE, "COAT_LEVELS")
"""Number of roughnesses in the table for a material with a map of roughness."""
NORMAL_MAPS = 2, 4
"""Places of the maps of normals in `Material.maps`."""

Lobe = Literal["diffuse", "glossy", "mirror"]
"""Kinds of lobes; a mirror has no roughness."""


@dataclass(frozen=True)
class Material:
    """The reflectance of a surface, in linear Rec.709.

    Attributes
    ----------
    kind : {"diffuse", "conductor", "plastic", "principled", "dielectric"}
        Lambertian; GGX with constant reflectance (no Fresnel term); a GGX dielectric coat over a
        Lambertian base; a mixture of such a plastic and a GGX metal with Schlick's Fresnel term
        (Khronos glTF 2.0, appendix B); or a GGX dielectric that refracts light.
    albedo : (r, g, b)
        Diffuse albedo in [0, 1], the conductor's reflectance at normal incidence, or the factor of
        light that crosses the dielectric's surface. It multiplies the texture.
    alpha : float
        GGX roughness of the conductor, the coat or the dielectric; 0 for a smooth surface.
    ior : float
        Index of refraction of the coat or the dielectric.
    texture : (H, W, 3) float32 or None
        Linear albedo image, row 0 at v = 1.
    metallic : float
        Share of the metal in a principled material.
    opacity : float
        Share of the rays that meet the surface; it multiplies the opacity texture.
    cutoff : float
        Opacity from which all rays meet the surface, and below which none do; 0: their share does.
    surface_texture : (H, W, 2) float32 or None
        Factors of `metallic` and of the square root of `alpha`, for principled materials.
    normal_texture : (H, W, 3) float32 or None
        Directions of the shading normal along the tangent, the bitangent and the mesh's normal, of
        any length.
    opacity_texture : (H, W) float32 or None
        Factors of `opacity`, of the size of `texture`, which must exist.
    emission : (r, g, b)
        Emitted radiance, the same in all directions and on both sides, in the panorama's unit.
    emission_texture : (H, W, 3) float32 or None
        Factors of `emission`.
    transmission : float
        Share of the light below a principled material's coat that passes, as through a dielectric,
        instead of being reflected diffusely.
    thin : bool
        A dielectric without inside, such as a window pane or a soap bubble: light goes straight on.
    absorption : (r, g, b)
        Of light inside of a dielectric, 1/m.
    priority : int
        Where dielectrics overlap, the one of the highest priority fills the space.
    clearcoat : float
        Strength of a clear coat above a principled material.
    clearcoat_alpha : float
        GGX roughness of the clear coat; 0 for a smooth one.
    clearcoat_normal_texture : (H, W, 3) float32 or None
        As `normal_texture`, of the clear coat. Without it the clear coat follows the mesh alone.
    sheen : (r, g, b)
        Color of the light that fibres of a principled material, below its clear coat, reflect at
        grazing angles.
    sheen_alpha : float
        Roughness of the sheen, the square of glTF's.
    tint : (r, g, b)
        Factor of the reflection of a principled material's plastic at normal incidence.
    samplers : tuple of five Sampler
        Of `texture` and `opacity_texture`, `surface_texture`, `normal_texture`,
        `emission_texture`, and `clearcoat_normal_texture`.
    places : tuple of four (Place or None)
        Of `surface_texture`, `normal_texture`, `emission_texture` and `clearcoat_normal_texture`,
        where they lie elsewhere than the mesh's `uvs` say. The other maps lie there.
    variants : Variants or None
        A map of other values of a principled material, whose means are its own.
    """

    kind: MaterialKind = "diffuse"
    albedo: tuple[float, float, float] = (0.5, 0.5, 0.5)
    alpha: float = 0.1
    ior: float = 1.5
    texture: NDArray[np.float32] | None = field(default=None, compare=False)
    metallic: float = 0.0
    opacity: float = 1.0
    cutoff: float = 0.0
    surface_texture: NDArray[np.float32] | None = field(default=None, compare=False)
    normal_texture: NDArray[np.float32] | None = field(default=None, compare=False)
    opacity_texture: NDArray[np.float32] | None = field(default=None, compare=False)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_texture: NDArray[np.float32] | None = field(default=None, compare=False)
    samplers: Samplers = ALL_PLAIN
    places: Places = ALL_ALIKE
    transmission: float = 0.0
    thin: bool = False
    absorption: tuple[float, float, float] = (0.0, 0.0, 0.0)
    priority: int = 0
    clearcoat: float = 0.0
    clearcoat_alpha: float = 0.0
    clearcoat_normal_texture: NDArray[np.float32] | None = field(default=None, compare=False)
    sheen: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sheen_alpha: float = 0.25
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    variants: Variants | None = None

    @cached_property
    def palette(self) -> tuple[Material, ...]:
        """The materials of `variants`, none without."""
        if self.variants is None or self.kind != "principled":
            return ()
        rows = (dict(zip(self.variants.names, row, strict=True)) for row in self.variants.values)
        return tuple(replace(self, variants=None, **row) for row in rows)

    def edited(self, **values: Any) -> Material:
        """Return the material with other values, which replace their maps among its variants."""
        kept = None if self.variants is None else self.variants.without(values)
        return replace(self, **{"variants": kept, **values})

    @property
    def transmits(self) -> bool:
        """True if light passes through the surface, reflected and refracted by it."""
        return self.kind == "dielectric" or (self.kind == "principled" and self.transmission > 0.0)

    @property
    def is_covered(self) -> bool:
        """True with a clear coat, sheen or a tint."""
        covers = self.clearcoat > 0.0 or max(self.sheen) > 0.0 or min(self.tint) < 1.0
        return self.kind == "principled" and covers

    @property
    def has_coat(self) -> bool:
        """True with a clear coat, maybe of a variant."""
        return self.kind == "principled" and any(
            one.clearcoat > 0.0 for one in (self, *self.palette)
        )

    @property
    def has_coat_normal(self) -> bool:
        """True if the normal of its clear coat may differ from the shading normal."""
        bumps = self.normal_texture, self.clearcoat_normal_texture
        return self.has_coat and any(image is not None for image in bumps)

    @property
    def maps(self) -> tuple[NDArray[np.float32] | None, ...]:
        """The textures of albedo, surface, normals, emission, and normals of the clear coat.

        None where the material has no use for one.
        """
        surface = self.surface_texture if self.kind == "principled" else None
        glow = self.emission_texture if self.emits else None
        lacquer = self.clearcoat_normal_texture if self.has_coat else None
        return self.texture, surface, self.normal_texture, glow, lacquer

    @property
    def map_places(self) -> tuple[Place | None, ...]:
        """The place of each of `maps`, None without the map too."""
        placed = zip(self.maps, (None, *self.places), strict=True)
        return tuple(None if image is None else place for image, place in placed)

    @property
    def emits(self) -> bool:
        """True if the surface is a light."""
        return max(self.emission) > 0.0

    @property
    def mean_emission(self) -> tuple[float, float, float]:
        """Emitted radiance, the mean over the texture."""
        if self.emission_texture is None:
            return self.emission
        r, g, b = self.emission_texture.mean(axis=(0, 1), dtype=np.float64) * self.emission
        return float(r), float(g), float(b)

    @property
    def has_holes(self) -> bool:
        """True if rays may pass through the surface."""
        return self.opacity < 1.0 or self.opacity_texture is not None

    @property
    def textured(self) -> bool:
        """True if it has a texture."""
        return any(image is not None for image in self.maps) or bool(self.palette)

    @property
    def is_mirror(self) -> bool:
        """True for a perfect mirror."""
        return self.kind == "conductor" and self.is_smooth

    @property
    def is_smooth(self) -> bool:
        """True if the specular lobe is a single direction."""
        return self.alpha < MIRROR_ALPHA

    @property
    def lobes(self) -> frozenset[Lobe]:
        """The lobes of the reflectance, of its variants too."""
        if self.palette:
            bare = replace(self, variants=None)
            return bare.lobes.union(*(variant.lobes for variant in self.palette))
        if self.kind == "diffuse":
            return frozenset({"diffuse"})
        only_specular = self.kind in ("conductor", "dielectric")
        mirror = only_specular and self.is_smooth and not self.is_covered
        specular: Lobe = "mirror" if mirror else "glossy"
        if self.kind == "principled" and self.maps[1] is None:
            only_specular = self.metallic >= 1.0 or self.transmission >= 1.0
        return frozenset({specular} if only_specular else {"diffuse", specular})


def table_rows(materials: Sequence[Material]) -> list[Material]:
    """Return the materials by the indices that kernels use: these, then all variants of each."""
    return [*materials, *(variant for material in materials for variant in material.palette)]


def first_variants(materials: Sequence[Material]) -> list[int]:
    """Return the index of the first variant of each material in `table_rows`; 0: it has none."""
    starts = np.cumsum([len(materials), *(len(material.palette) for material in materials)])
    places = zip(materials, starts, strict=False)
    return [int(start) if material.palette else 0 for material, start in places]


def material_table(materials: Sequence[Material]) -> NDArray[np.float32]:
    """Return the table of materials that kernels read; albedo comes with each hit instead.

    Parameters
    ----------
    materials : sequence of Material
        Of all objects. The table has a row for each of `table_rows`.

    Returns
    -------
    (MATERIAL_ROWS * N, 4) float32
        Per material, with the means of its maps: kind, alpha (0 or at least `MIN_ALPHA`), index of
        refraction, scale factor of the base below a coat; the coat's transmittance at cosines
        (i / 31)², i = 0..31; metalness, index of the entries for its map of roughness, transmission
        and thinness; absorption and priority; the cover (`cl/lib/world/cover.h`); emission and
        the mean of its channels. The fourth number of the cover is the index of the material, of
        which this is a variant, or its own. Entries for maps of roughness follow the variants,
        `COAT_LEVELS` for each index of refraction.
        Without materials there is one of zeros.
    """
    rows = table_rows(materials)
    mapped = [material.ior for material in rows if material.maps[1] is not None]
    levels = {ior: index for index, ior in enumerate(dict.fromkeys(mapped))}
    entries = [_entry(mean) for mean in table_rows([_with_means(one) for one in materials])]
    bases = [*range(len(materials))]
    bases += [base for base in range(len(materials)) for _ in materials[base].palette]
    for material, base, entry in zip(rows, bases, entries, strict=True):
        entry[_COVER_ROW, 3] = base
        if material.maps[1] is not None:
            entry[_FINISH_ROW, 1] = len(rows) + COAT_LEVELS * levels[material.ior]
    for ior in levels:
        roughness = np.linspace(0.0, 1.0, COAT_LEVELS)
        entries += [_entry(Material("principled", alpha=r * r, ior=ior)) for r in roughness]
    entries = entries or [np.zeros((MATERIAL_ROWS, 4), np.float32)]
    return np.reshape(entries, (-1, 4)).astype(np.float32)


def _with_means(material: Material) -> Material:
    """Return the material with the means of its maps of a principled surface and of emission."""
    material = replace(material, emission=material.mean_emission, emission_texture=None)
    surface = material.maps[1]
    if surface is None:
        return material
    metallic = material.metallic * float(surface[..., 0].mean())
    alpha = material.alpha * float(np.square(surface[..., 1]).mean())
    return replace(material, metallic=metallic, alpha=alpha, surface_texture=None)


def _entry(material: Material) -> NDArray[np.float32]:
    entry = np.zeros((MATERIAL_ROWS, 4), np.float32)
    alpha = 0.0 if material.is_smooth else max(material.alpha, MIN_ALPHA)
    entry[0, :3] = _KINDS[material.kind], alpha, material.ior
    if material.kind in ("plastic", "principled"):
        coat = _coat(alpha, material.ior)
        entry[0, 3], entry[1:_FINISH_ROW] = coat["base"], coat["transmittance"]
    entry[_FINISH_ROW] = material.metallic, 0.0, material.transmission, material.thin
    entry[_MEDIUM_ROW] = *material.absorption, material.priority
    entry[_COVER_ROW:-1] = _cover(material)
    entry[-1] = *material.emission, sum(material.emission) / 3.0
    return entry


def _cover(material: Material) -> NDArray[np.float32]:
    """Return the rows of the layers above a material."""
    rows = np.zeros((MATERIAL_ROWS - 1 - _COVER_ROW, 4), np.float32)
    rows[0, 2], rows[2, :3] = 1.0, 1.0
    if material.is_covered:
        smooth = material.clearcoat_alpha < MIRROR_ALPHA
        alpha = 0.0 if smooth else max(material.clearcoat_alpha, MIN_ALPHA)
        sheen_alpha = max(material.sheen_alpha, MIN_SHEEN_ALPHA)
        rows[0, :3] = material.clearcoat, alpha, sheen_alpha
        rows[1] = *material.sheen, max(material.sheen)
        rows[2, :3] = material.tint
        rows[3:11], rows[11:19] = clearcoat_table(alpha), sheen_table(sheen_alpha)
    return rows


@lru_cache(maxsize=256)
def _coat(alpha: float, ior: float) -> Arrays:
    """Return a coat's part of the table, which is kept: its integrals take long."""

    def make() -> Arrays:
        cosine = np.linspace(0, 1, _NODES) ** 2
        escaping = 1 - internal_reflectance(alpha, ior)
        transmittance = rough_transmittance(cosine, alpha, ior).astype(np.float32)
        return {
            "base": np.array(1 / (ior**2 * escaping)),
            "transmittance": transmittance.reshape(-1, 4),
        }

    return kept("coat", __name__, [alpha, ior], make)
