"""Online illumination learning: local linear models of the radiance of real surfaces."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from iprt.settings.methods import MethodInfo, Needs
from iprt.settings.path_tracing import PATH_DEFAULTS, PathSettings


class OilSettings(PathSettings):
    """Path tracing in the local region."""

    surfaces: Literal["region", "all"] = Field(
        default="region",
        description="Real surfaces that objects shadow and light. region: those within the boxes "
        "of objects, enlarged by `oil.region`, as published. all: any.",
    )
    region: float = Field(
        default=0.15,
        ge=0.0,
        le=10.0,
        description="Share of their size by which the boxes of objects are enlarged.",
    )


METHOD = MethodInfo(
    "oil",
    "Path tracing with radiance of real surfaces that is learned from the video",
    "iprt.methods.oil.method:OnlineIllumination",
    paper="Lee, Jeong, Choi, Kim and Moon, Online Illumination Learning for Interactive Global "
    "Illumination in Augmented Reality, IEEE Access 2022",
    doi="10.1109/ACCESS.2022.3214516",
    settings=OilSettings,
    needs=lambda settings: Needs(tracing=True, relit=True, irradiance=True),
    defaults={
        **{key: value for key, value in PATH_DEFAULTS.items() if key != "atrous.levels"},
        "trace.rays": 2,
        "trace.object_rays": 2,
    },
)
