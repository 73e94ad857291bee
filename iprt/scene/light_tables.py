"""Tables of `scene.toml` that describe lights without geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError, model_validator

from iprt.errors import SceneError
from iprt.files.toml_tables import RelativePath, Table, describe
from iprt.geometry.ies import Luminaire
from iprt.geometry.light import SUN_DEG, Light

LUMEN_PER_WATT = 179.0
"""Luminous efficacy of white light in lm/W, by which the program Radiance converts."""
LightUnit = Literal["relative", "candela", "lumen", "watt"]
SunUnit = Literal["relative", "lux"]
Power = Annotated[float, Field(ge=0.0, le=1e9)]
Radius = Annotated[float, Field(ge=0.0, le=1e3)]
_HalfAngle = Annotated[float, Field(ge=0.0, le=90.0)]
_Tint = Annotated[list[Annotated[float, Field(ge=0.0, le=1e3)]], Field(min_length=3, max_length=3)]
_Side = Annotated[float, Field(gt=0.0, le=1e3)]


def _widening(angles: list[float]) -> list[float]:
    if not angles[0] <= angles[1]:
        raise ValueError(f"{angles}: the inner half angle is larger than the outer one")
    return angles


class _LightTable(Table):
    """A light of a `power` that holds for white; `color` multiplies it."""

    color: _Tint = Field(default=[1.0, 1.0, 1.0])

    def _with_intensity(self, shape: Light, intensity: float) -> Light:
        red, green, blue = (intensity * channel for channel in self.color)
        return replace(shape, intensity=(red, green, blue))


class _LampTable(_LightTable):
    """A light in the room. A unit of "relative" is intensity: the panorama's radiance times m²."""

    unit: LightUnit = "relative"

    def _with_power(self, shape: Light, power: float, unit: LightUnit, nits: float) -> Light:
        if unit == "relative":
            return self._with_intensity(shape, power)
        lumen = power * {"candela": shape.solid_angle, "lumen": 1.0, "watt": LUMEN_PER_WATT}[unit]
        return self._with_intensity(shape, lumen / shape.solid_angle / nits)


class PointTable(_LampTable):
    """A point or a sphere that shines evenly, or as a photometric file says."""

    kind: Literal["point"]
    power: Power | None = None
    radius: Radius = 0.0
    profile: RelativePath | None = None

    @model_validator(mode="after")
    def _has_power(self) -> Self:
        if self.power is None and self.profile is None:
            raise ValueError("needs a power, or a profile whose power it takes")
        return self

    def light(self, nits: float, luminaire: Luminaire | None = None) -> Light:
        """Return the light.

        Parameters
        ----------
        nits : float
            Luminance of a radiance of 1, in cd/m².
        luminaire : Luminaire or None
            Content of the file `profile`. Its largest intensity is the default power.
        """
        profile = None if luminaire is None else luminaire.profile
        shape = Light("sphere", radius=self.radius, profile=profile)
        if self.power is None and luminaire is not None:
            return self._with_power(shape, luminaire.candela, "candela", nits)
        return self._with_power(shape, self.power or 0.0, self.unit, nits)


class SpotTable(_LampTable):
    """A point or a sphere that shines in a cone around -Z."""

    kind: Literal["spot"]
    power: Power
    radius: Radius = 0.0
    cone_deg: Annotated[
        list[_HalfAngle], Field(min_length=2, max_length=2), AfterValidator(_widening)
    ] = Field(default=[20.0, 30.0])

    def light(self, nits: float, luminaire: Luminaire | None = None) -> Light:
        """Return the light, as `PointTable.light` does."""
        inner, outer = self.cone_deg
        shape = Light("sphere", radius=self.radius, cone_deg=(inner, outer))
        return self._with_power(shape, self.power, self.unit, nits)


class RectangleTable(_LampTable):
    """A rectangle that shines to the side of -Z."""

    kind: Literal["rectangle"]
    power: Power
    size: Annotated[list[_Side], Field(min_length=2, max_length=2)] = Field(default=[0.5, 0.5])

    def light(self, nits: float, luminaire: Luminaire | None = None) -> Light:
        """Return the light, as `PointTable.light` does."""
        shape = Light("rectangle", size=(self.size[0], self.size[1]))
        return self._with_power(shape, self.power, self.unit, nits)


class SunLightTable(_LightTable):
    """A distant disc that shines along -Z; a unit of "relative" is the irradiance across."""

    kind: Literal["sun"]
    power: Power
    unit: SunUnit = "relative"
    diameter_deg: Annotated[float, Field(ge=0.0, le=90.0)] = SUN_DEG

    def light(self, nits: float, luminaire: Luminaire | None = None) -> Light:
        """Return the light, as `PointTable.light` does."""
        shape = Light("sun", diameter_deg=self.diameter_deg)
        return self._with_intensity(shape, self.power / (1.0 if self.unit == "relative" else nits))


LIGHTS: Mapping[str, type[_LightTable]] = {
    "point": PointTable,
    "spot": SpotTable,
    "rectangle": RectangleTable,
    "sun": SunLightTable,
}
"""Tables by their `kind`."""
LightTable = Annotated[
    PointTable | SpotTable | RectangleTable | SunLightTable, Field(discriminator="kind")
]
"""`light` of an object."""
_READER: TypeAdapter[PointTable | SpotTable | RectangleTable | SunLightTable] = TypeAdapter(
    LightTable
)


def checked_light(values: dict[str, Any]) -> LightTable:
    """Check the values of a light, by key.

    Raises
    ------
    SceneError
        A value is missing, unknown or out of range; a line names the first one.
    """
    try:
        return _READER.validate_python(values)
    except ValidationError as error:
        problem = error.errors()[0]
        location = ("light", *problem["loc"])
        table = LIGHTS.get(values.get("kind", ""))
        raise SceneError(describe({**problem, "loc": location}, {"light": values}, table)) from None


def described(light: LightTable) -> str:
    """Describe a light in words."""
    if light.power is None:
        return f"{light.kind}, as bright as its profile says"
    unit = "" if light.unit == "relative" else f" {light.unit}"
    return f"{light.kind}, {light.power:g}{unit}"


def written_light(light: LightTable) -> dict[str, Any]:
    """Return the keys of a light that differ from the defaults, as `scene.toml` has them."""
    return light.model_dump(exclude_defaults=True)
