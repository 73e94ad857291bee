"""Tables of `scene.toml` that describe materials."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from iprt.files.toml_tables import Color, Ior, Name, Point, RelativePath, Table, Unit, not_null
from iprt.footage.real_material import Plane, RealMaterial
from iprt.geometry.material import MAX_ABSORPTION, MAX_EMISSION, Material
from iprt.scene.material_maps import MAPS, MapName

Emission = Annotated[
    list[Annotated[float, Field(ge=0.0, le=MAX_EMISSION)]], Field(min_length=3, max_length=3)
]
Absorption = Annotated[
    list[Annotated[float, Field(ge=0.0, le=MAX_ABSORPTION)]], Field(min_length=3, max_length=3)
]
Priority = Annotated[int, Field(ge=-1000, le=1000)]


class _SurfaceTable(Table):
    """A surface that may have maps and holes, and emit radiance in the panorama's unit."""

    texture: RelativePath | None = None
    normal_texture: RelativePath | None = None
    emission: Emission = Field(default=[0.0, 0.0, 0.0])
    emission_texture: RelativePath | None = None
    opacity: Unit = 1.0
    opacity_texture: RelativePath | None = None
    cutoff: Unit = 0.0

    @property
    def maps(self) -> dict[MapName, str]:
        """Names of the given maps' files, by key."""
        named = {key: getattr(self, key, None) for key in MAPS}
        return {key: name for key, name in named.items() if name is not None}

    def finished(self, material: Material) -> Material:
        """Return a material with this emission and these holes."""
        emission = _triple(self.emission)
        return replace(material, emission=emission, opacity=self.opacity, cutoff=self.cutoff)


class _TransmittingTable(_SurfaceTable):
    """A material that may let light pass: a thin wall, or a solid that absorbs light, in 1/m."""

    thin: bool = False
    absorption: Absorption = Field(default=[0.0, 0.0, 0.0])
    priority: Priority = 0

    def transmitting(self, material: Material) -> Material:
        """Return a material with these properties."""
        return replace(
            material,
            thin=self.thin,
            absorption=_triple(self.absorption),
            priority=self.priority,
        )


class DiffuseTable(_SurfaceTable):
    """A diffuse material."""

    kind: Literal["diffuse"]
    albedo: Color

    def material(self) -> Material:
        """Build the material."""
        return Material("diffuse", _triple(self.albedo))


class _ConductorFields(Table):
    """A metal or a mirror."""

    kind: Literal["conductor"]
    reflectance: Color
    alpha: Unit = 0.1

    def material(self) -> Material:
        """Build the material."""
        return Material("conductor", _triple(self.reflectance), alpha=self.alpha)


class ConductorTable(_ConductorFields, _SurfaceTable):
    """A conductor: a metal or a mirror."""


class PlasticTable(_SurfaceTable):
    """A plastic: a dielectric coat over a diffuse base."""

    kind: Literal["plastic"]
    albedo: Color
    alpha: Unit = 0.1
    ior: Ior = 1.5

    def material(self) -> Material:
        """Build the material."""
        return Material("plastic", _triple(self.albedo), alpha=self.alpha, ior=self.ior)


class PrincipledTable(_TransmittingTable):
    """A mixture of a plastic, a metal and a dielectric, as in glTF, and its layers."""

    kind: Literal["principled"]
    albedo: Color
    metallic: Unit = 0.0
    alpha: Unit = 0.1
    ior: Ior = 1.5
    transmission: Unit = 0.0
    clearcoat: Unit = 0.0
    clearcoat_alpha: Unit = 0.0
    clearcoat_normal_texture: RelativePath | None = None
    sheen: Color = Field(default=[0.0, 0.0, 0.0])
    sheen_alpha: Unit = 0.25
    tint: Color = Field(default=[1.0, 1.0, 1.0])
    surface_texture: RelativePath | None = None

    def material(self) -> Material:
        """Build the material."""
        return self.transmitting(
            Material(
                "principled",
                _triple(self.albedo),
                alpha=self.alpha,
                ior=self.ior,
                metallic=self.metallic,
                transmission=self.transmission,
                clearcoat=self.clearcoat,
                clearcoat_alpha=self.clearcoat_alpha,
                sheen=_triple(self.sheen),
                sheen_alpha=self.sheen_alpha,
                tint=_triple(self.tint),
            )
        )


class DielectricTable(_TransmittingTable):
    """A dielectric that refracts light, such as glass or water."""

    kind: Literal["dielectric"]
    transmittance: Color = Field(default=[1.0, 1.0, 1.0])
    alpha: Unit = 0.0
    ior: Ior = 1.5

    def material(self) -> Material:
        """Build the material."""
        color = _triple(self.transmittance)
        return self.transmitting(Material("dielectric", color, alpha=self.alpha, ior=self.ior))


MaterialTable = Annotated[
    DiffuseTable | ConductorTable | PlasticTable | PrincipledTable | DielectricTable,
    Field(discriminator="kind"),
]


Radiance = Annotated[
    list[Annotated[float, Field(ge=0.0, le=1e12)]],
    Field(min_length=3, max_length=3),
    AfterValidator(not_null),
]


class PlaneTable(Table):
    """A plane in the world, in metres."""

    point: Point
    normal: Annotated[Point, AfterValidator(not_null)]
    tolerance: Annotated[float, Field(gt=0.0)] = 0.02

    @property
    def plane(self) -> Plane:
        """The plane with a unit normal."""
        length = math.hypot(*self.normal)
        normal = [value / length for value in self.normal]
        return Plane(_triple(self.point), _triple(normal), self.tolerance)


class _RealMaterialTable(Table, ABC):
    """`[[real_materials]]`: a glossy surface in the panorama; all given conditions must hold."""

    name: Name
    mask: RelativePath | None = None
    color: Radiance | None = None
    color_tolerance: Annotated[float, Field(gt=0.0)] = 0.05
    plane: PlaneTable | None = None

    @field_validator("color_tolerance")
    @classmethod
    def _has_color(cls, tolerance: float, info: ValidationInfo) -> float:
        if info.data.get("color", tolerance) is None:
            raise ValueError("has no effect without color; give color too")
        return tolerance

    @model_validator(mode="after")
    def _says_where(self) -> Self:
        if self.mask is None and self.color is None and self.plane is None:
            raise ValueError("say where the surface is: give a mask, a color or a plane")
        return self

    def real_material(self, mask: NDArray[np.bool_] | None) -> RealMaterial:
        """Build the real material; `mask` holds the pixels of the named file."""
        return RealMaterial(
            self.name,
            self.material(),
            mask=mask,
            color=None if self.color is None else _triple(self.color),
            color_tolerance=self.color_tolerance,
            plane=None if self.plane is None else self.plane.plane,
        )

    @abstractmethod
    def material(self) -> Material:
        """Build the reflectance of this kind."""


class RealConductorTable(_ConductorFields, _RealMaterialTable):
    """A conductor: a metal or a mirror."""


class RealPlasticTable(_RealMaterialTable):
    """A plastic coat; the panorama itself is the base."""

    kind: Literal["plastic"]
    alpha: Unit = 0.1
    ior: Ior = 1.5

    def material(self) -> Material:
        """Build the reflectance of the coat."""
        return Material("plastic", alpha=self.alpha, ior=self.ior)


RealMaterialTable = Annotated[RealConductorTable | RealPlasticTable, Field(discriminator="kind")]


def _triple(values: list[float]) -> tuple[float, float, float]:
    r, g, b = values
    return r, g, b
