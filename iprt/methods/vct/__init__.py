"""Voxel cone tracing: light gathered by cones through voxels of the room and of the objects."""

from __future__ import annotations

from pydantic import Field

from iprt.settings.methods import MethodInfo, MethodSettings, Needs
from iprt.settings.model import Settings


class VctSettings(MethodSettings):
    """Voxels of the room and of the objects, and the cones that are traced through them."""

    cones: int = Field(
        default=64,
        ge=16,
        le=128,
        description="Cones that fill a hemisphere: more are narrower. A frame traces a few of them "
        "(trace.rays, trace.object_rays).",
    )
    voxels: int = Field(
        default=128,
        ge=16,
        le=512,
        description="Resolution n of the volume of the room, of at most n^3 voxels.",
    )
    object_voxels: int = Field(
        default=64,
        ge=16,
        le=256,
        description="Resolution n of the volume around the objects, of at most n^3 voxels.",
    )
    anisotropic: bool = Field(
        default=True,
        description="Coarse voxels have an opacity along each axis; off: one for all directions, "
        "which lets light through walls and makes shadows fainter.",
    )


def _needs(settings: Settings) -> Needs:
    return Needs(tracing=True, relit=True, irradiance=True)


METHOD = MethodInfo(
    "vct",
    "Voxel cone tracing of the room and the objects",
    "iprt.methods.vct.method:VoxelConeTracing",
    paper="Rohmer, Jendersie and Grosch, Natural Environment Illumination: Coherent Interactive "
    "Augmented Reality for Mobile and non-Mobile Devices, IEEE TVCG 2017",
    doi="10.1109/TVCG.2017.2734426",
    settings=VctSettings,
    needs=_needs,
    defaults={
        "trace.rays": 2,
        "trace.object_rays": 4,
        "trace.jitter": False,
        "trace.background": False,
    },
)
