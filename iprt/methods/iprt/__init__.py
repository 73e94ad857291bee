"""The default method: IPRT, with triangles, a cache of E_R, and a variance-guided filter."""

from __future__ import annotations

from pydantic import Field

from iprt.settings.methods import MethodInfo, MethodSettings, Needs
from iprt.settings.model import Settings


class IprtSettings(MethodSettings):
    """Reflections of relit real surfaces in objects."""

    relight_reflections: bool = Field(
        default=True, description="Objects reflect shadows and light that objects cast."
    )
    ratio_rows: int = Field(
        default=64,
        ge=16,
        le=2048,
        description="Rows of the panorama that holds such shadows outside the view.",
        json_schema_extra={"unit": "rows"},
    )


def _needs(settings: Settings) -> Needs:
    own = settings.own(IprtSettings)
    return Needs(
        tracing=True,
        relit=True,
        irradiance=True,
        gloss=True,
        sun=True,
        lights=True,
        relit_reflections=own.relight_reflections,
        ratio_rows=own.ratio_rows,
    )


METHOD = MethodInfo(
    "iprt",
    "Panoramic ray tracing over triangles, with cached irradiance",
    "iprt.methods.iprt.method:Iprt",
    settings=IprtSettings,
    needs=_needs,
)
