"""Environment mapping: the panorama as a distant environment, occluded by the objects."""

from __future__ import annotations

from pydantic import Field

from iprt.settings.methods import MethodInfo, MethodSettings, Needs
from iprt.settings.model import Settings


class EmSettings(MethodSettings):
    """Occlusion of the environment."""

    visibility: bool = Field(
        default=True,
        description="Objects hide the environment from each other, from themselves and from real "
        "surfaces; off: as the method ibl.",
    )


def _needs(settings: Settings) -> Needs:
    if not settings.own(EmSettings).visibility:
        return Needs()
    return Needs(tracing=True, distant=True, relit=True, irradiance=True)


METHOD = MethodInfo(
    "em",
    "The panorama as a distant environment, with shadows of objects",
    "iprt.trace.sparse:SparseMethod",
    paper="Rohmer, Jendersie and Grosch, Natural Environment Illumination: Coherent Interactive "
    "Augmented Reality for Mobile and non-Mobile Devices, IEEE TVCG 2017",
    doi="10.1109/TVCG.2017.2734426",
    settings=EmSettings,
    needs=_needs,
    defaults={"trace.rays": 8, "trace.object_rays": 16, "trace.bounces": 1},
)
