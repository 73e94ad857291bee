"""Distance impostor tracing: rays against a map of radiance and distance around the objects."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from iprt.settings.methods import MethodInfo, MethodSettings, Needs
from iprt.settings.model import Settings


class DitSettings(MethodSettings):
    """Resolution of the impostor, and directions of the rays from real surfaces."""

    resolution: int = Field(
        default=256,
        ge=8,
        le=2048,
        description="Texels along each side of the cube map around the objects.",
        json_schema_extra={"unit": "texels"},
    )
    iterations: int = Field(
        default=4,
        ge=0,
        le=64,
        description="Steps that refine where a ray meets the map; 0: the first guess.",
        json_schema_extra={"unit": "steps"},
    )
    directions: Literal["cached", "all", "boxes"] = Field(
        default="cached",
        description="Directions of rays from real surfaces. cached: of the sampled directions, "
        "the ones that hit the boxes around objects are traced, up to `cache` rays; all: each is "
        "traced; boxes: they are aimed at the boxes, as in em.",
    )
    cache: int = Field(
        default=8,
        ge=1,
        le=1024,
        description="Most rays traced of the `trace.rays` sampled directions, with directions = "
        "cached.",
        json_schema_extra={"unit": "rays"},
    )


def _needs(settings: Settings) -> Needs:
    return Needs(tracing=True, impostor=True, relit=True, irradiance=True)


METHOD = MethodInfo(
    "dit",
    "Rays through a map of radiance and distance around the objects",
    "iprt.methods.dit.method:DistanceImpostorTracing",
    paper="Rohmer, Jendersie and Grosch, Natural Environment Illumination: Coherent Interactive "
    "Augmented Reality for Mobile and non-Mobile Devices, IEEE TVCG 2017",
    doi="10.1109/TVCG.2017.2734426",
    settings=DitSettings,
    needs=_needs,
    defaults={"trace.rays": 16, "trace.object_rays": 16, "trace.bounces": 1},
)
