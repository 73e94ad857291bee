"""Delta path tracing: only what objects hide and send, by paths with next event estimation."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from iprt.settings.methods import MethodInfo, MethodSettings, Needs
from iprt.settings.model import Settings


class PathSettings(MethodSettings):
    """Paths."""

    bounces: int = Field(
        default=3,
        ge=1,
        le=10,
        description="Surfaces that a path may meet, the one in the view included: 1 is direct "
        "light, and each further one costs less than the one before.",
    )


class PathTracingSettings(PathSettings):
    """Path tracing of objects and of the real surfaces around them."""

    surfaces: Literal["plane", "all"] = Field(
        default="plane",
        description="plane: the plane below the objects, in a panorama infinitely far away, as "
        "published. all: any real surface, in the panorama with its depth; slower, and right where "
        "the room is near.",
    )


class DptSettings(PathTracingSettings):
    """Delta path tracing."""


def needs(own: PathTracingSettings) -> Needs:
    """What path tracing asks of the worlds."""
    return Needs(
        tracing=True,
        distant=own.surfaces == "plane",
        relit=True,
        irradiance=True,
        published_filter=True,
    )


def _needs(settings: Settings) -> Needs:
    return needs(settings.own(DptSettings))


DEFAULTS = {
    "trace.rays": 4,
    "trace.object_rays": 4,
    "trace.jitter": False,
    "trace.background": False,
    "mask.sparse": False,
    "atrous.levels": 1,
}
"""Every pixel is traced, and one level of the filter has 5x5 taps."""

METHOD = MethodInfo(
    "dpt",
    "Delta path tracing on a plane or on any real surface",
    "iprt.methods.path_tracing:DeltaPathTracing",
    paper="Xu, Jiang, Wang, Li and Geng, Delta Path Tracing for Real-Time Global Illumination in "
    "Mixed Reality, IEEE VR 2023",
    doi="10.1109/VR55154.2023.00020",
    settings=DptSettings,
    needs=_needs,
    defaults=DEFAULTS,
)
