"""Cone tracing through the voxels of the room and of the objects."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.device.program import Define
from iprt.settings.features import Features
from iprt.trace.tracers import RayKernel
from iprt.trace.voxel_world import VoxelWorld
from iprt.world.world import World


def _defines(features: Features) -> dict[str, Define]:
    """Return the `-D` definitions of kernels that trace cones."""
    return {
        "OPENING_ENVIRONMENT": features.opening_environment,
    }


def cones_from_real(file: str, features: Features, voxels: VoxelWorld, cones: int) -> RayKernel:
    """Return the kernel that sends cones from real surfaces, through all voxels."""
    return RayKernel(file, _defines(features), lambda *_: voxels.arguments(), {"cones": cones})


def cones_from_virtual(features: Features, voxels: VoxelWorld, cones: int) -> RayKernel:
    """Return the kernel that sends cones from virtual surfaces, through all voxels."""

    def scene(world: World, _: cla.Array) -> dict[str, Any]:
        return voxels.arguments() | {"materials": world.objects.materials}

    defines = {
        "DELTA": voxels.delta is not None,
        **features.materials.defines(),
        **_defines(features),
    }
    return RayKernel("trace/cone_virtual", defines, scene, {"cones": cones})
