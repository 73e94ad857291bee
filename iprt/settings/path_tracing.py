"""Settings that methods of path tracing share."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from pydantic import Field

from iprt.settings.methods import MethodSettings, Needs


class PathSettings(MethodSettings):
    """Length of paths."""

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

    def needs(self) -> Needs:
        """Return what path tracing needs of the worlds."""
        return Needs(
            tracing=True,
            distant=self.surfaces == "plane",
            relit=True,
            irradiance=True,
            published_filter=True,
        )


PATH_DEFAULTS: Mapping[str, object] = MappingProxyType(
    {
        "trace.rays": 4,
        "trace.object_rays": 4,
        "trace.jitter": False,
        "trace.background": False,
        "mask.sparse": False,
        "atrous.levels": 1,
    }
)
"""Defaults as published: every pixel is traced, and the filter has a single level of 5x5 taps."""
