"""Cone tracing through the voxels of the room and of the objects."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.settings.features import TOUCHED_FRAMES, Features
from iprt.trace.tracers import RealTracer, VirtualTracer
from iprt.trace.voxel_world import VoxelWorld
from iprt.world.world import World


def cone_defines(features: Features) -> dict[str, Define]:
    """Return the `-D` definitions of kernels that trace cones."""
    return {
        "OPENING_ENVIRONMENT": features.opening_environment,
        "TOUCHED_FRAMES": TOUCHED_FRAMES,
    }


class ConeReal(RealTracer):
    """Cones from real surfaces, through the voxels of the objects and of their surroundings."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        name: str,
        kernel: str,
        voxels: VoxelWorld,
        cones: int,
    ) -> None:
        self._voxels = voxels
        defines = plane_defines() | cone_defines(features)
        super().__init__(device, guide, features, kernel, defines, name=name, cones=cones)

    def arguments(self, world: World, view: cla.Array) -> dict[str, Any]:
        """Return the voxels as kernel arguments."""
        return self._voxels.arguments()


class ConeVirtual(VirtualTracer):
    """Cones from virtual surfaces, through the voxels of the objects and of the room."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        voxels: VoxelWorld,
        cones: int,
    ) -> None:
        self._voxels = voxels
        defines = guide.defines(
            DELTA=voxels.delta is not None,
            **cone_defines(features),
        )
        super().__init__(device, guide, features, "trace/cone_virtual", defines, cones=cones)

    def arguments(self, world: World, view: cla.Array) -> dict[str, Any]:
        """Return the voxels and the materials as kernel arguments."""
        return self._voxels.arguments() | {"materials": world.objects.materials}
