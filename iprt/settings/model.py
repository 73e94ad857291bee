"""The model of all settings of the renderer, the source of TOML keys, flags and sliders."""

from __future__ import annotations

from typing import Any, Literal, TypeVar

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from iprt.settings.filter import AtrousSettings, MaskSettings, TemporalSettings
from iprt.settings.methods import DEFAULT, MethodSettings, SettingsGroup, methods
from iprt.settings.trace import (
    GlossSettings,
    IrradianceSettings,
    LearningSettings,
    TraceSettings,
)

OwnSettings = TypeVar("OwnSettings", bound=MethodSettings)


class Settings(SettingsGroup):
    """Settings of a renderer; immutable, so that they can be stored with a picture.

    Each installed method with settings of its own adds a group under the method's name. Omitted
    fields have the method's defaults.

    Attributes
    ----------
    of_methods : tuple of MethodSettings
        Settings of all methods that have any; use `own`. Serialized data hold them under the
        methods' names instead.
    """

    method: str = Field(
        default=DEFAULT,
        description="Relighting method; `iprt methods` lists them.",
        json_schema_extra=lambda schema: schema.update(enum=list(methods())),
    )
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of all random numbers.")
    fading: float = Field(
        default=0.1,
        ge=0.0,
        le=1.0,
        description="Least weight of a new frame in the temporal mean; while objects move, twice "
        "that on real surfaces and three times in reflected light; 0 averages all frames.",
    )
    drift: bool = Field(
        default=True,
        description="Remove the drift of a video's exposure and white balance from the radiance "
        "that rays find, and apply it to the picture: histories stay valid while the camera "
        "adapts.",
    )
    gbuffer: Literal["auto", "gl", "cl"] = Field(
        default="auto",
        description="Renderer of the objects in the view: OpenGL, or rays in OpenCL. auto: "
        "rays where the OpenCL device is a CPU; elsewhere whichever is faster when objects come "
        "into view, so that pictures of two runs may differ in the samples of outlines.",
    )
    light_scale: int = Field(
        default=1,
        ge=1,
        le=8,
        description="Side of the blocks of pixels for which light is computed once, and then "
        "blended along surfaces; outlines and textures stay sharp.",
        json_schema_extra={"unit": "px"},
    )
    coverage_samples: int = Field(
        default=4,
        ge=1,
        le=8,
        description="Samples along each side of a pixel, which smooth the outlines of objects. "
        "With fewer than 4, pixels whose neighbours are covered count as covered.",
        json_schema_extra={"unit": "samples"},
    )
    trace: TraceSettings = TraceSettings()
    gloss: GlossSettings = GlossSettings()
    irradiance: IrradianceSettings = IrradianceSettings()
    learning: LearningSettings = LearningSettings()
    mask: MaskSettings = MaskSettings()
    temporal: TemporalSettings = TemporalSettings()
    atrous: AtrousSettings = AtrousSettings()
    of_methods: tuple[MethodSettings, ...] = ()

    def own(self, kind: type[OwnSettings]) -> OwnSettings:
        """Return the settings of a method, by their class."""
        return next(group for group in self.of_methods if isinstance(group, kind))

    @field_validator("method")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in methods():
            raise ValueError(f"expected {' or '.join(methods())}")
        return name

    @model_validator(mode="before")
    @classmethod
    def _with_methods(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Collect the groups of the methods, and add the defaults of the chosen method."""
        data = dict(data)
        chosen = methods().get(data.get("method", DEFAULT))
        for key, value in chosen.defaults.items() if chosen else ():
            group, _, name = key.partition(".")
            given = data.get(group, {})
            if isinstance(given, dict):
                data[group] = {name: value} | given
        if "of_methods" not in data:
            data["of_methods"] = tuple(
                info.settings.model_validate(data.pop(name, {}))
                for name, info in methods().items()
                if info.settings is not None
            )
        return data

    @model_serializer(mode="wrap")
    def _flat(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = handler(self)
        del data["of_methods"]
        names = (name for name, info in methods().items() if info.settings is not None)
        own = (group.model_dump() for group in self.of_methods)
        return data | dict(zip(names, own, strict=True))
