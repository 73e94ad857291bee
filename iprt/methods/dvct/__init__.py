"""Delta voxel cone tracing: the objects' change of light as radiance and antiradiance in voxels."""

from __future__ import annotations

from pydantic import Field

from iprt.settings.methods import MethodInfo, MethodSettings, Needs
from iprt.settings.model import Settings


class DvctSettings(MethodSettings):
    """Lights, the volumes around the objects, and the cones that are traced through them."""

    lights: int = Field(
        default=32,
        ge=1,
        le=256,
        description="Area lights that replace the panorama, by a median cut. A frame traces cones "
        "towards a few of them (trace.rays).",
    )
    map_side: int = Field(
        default=64,
        ge=8,
        le=1024,
        description="Texels along each side of a light's shadow map.",
    )
    cones: int = Field(
        default=9,
        ge=2,
        le=64,
        description="Diffuse cones that fill a hemisphere. A frame traces a few of them "
        "(trace.rays, trace.object_rays).",
    )
    voxels: int = Field(
        default=64,
        ge=16,
        le=512,
        description="Resolution n of the volumes around the objects, of at most n^3 voxels.",
    )
    room_voxels: int = Field(
        default=128,
        ge=16,
        le=512,
        description="Resolution n of the volume of the room, which objects reflect.",
    )
    anisotropic: bool = Field(
        default=True,
        description="Coarse voxels have an opacity along each axis; off: one for all directions.",
    )


def _needs(settings: Settings) -> Needs:
    return Needs(tracing=True, relit=True, irradiance=True, gloss=True)


METHOD = MethodInfo(
    "dvct",
    "Delta voxel cone tracing of the objects' change of light",
    "iprt.methods.dvct.method:DeltaVoxelConeTracing",
    paper="Franke, Delta Voxel Cone Tracing, IEEE ISMAR 2014",
    doi="10.1109/ISMAR.2014.6948407",
    settings=DvctSettings,
    needs=_needs,
    defaults={
        "trace.rays": 2,
        "trace.object_rays": 4,
        "trace.jitter": False,
        "trace.background": False,
    },
)
