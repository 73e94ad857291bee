"""Voxel cone tracing: what cones find in the voxels of the room and of the objects."""

from __future__ import annotations

from functools import partial
from typing import Any

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.methods.protocol import Setup, Signals
from iprt.methods.sparse import SparseMethod, Tracers
from iprt.methods.trace import RealTracer, VirtualTracer
from iprt.methods.vct import VctSettings
from iprt.methods.voxel_world import GatheringWorld, VoxelWorld
from iprt.settings.features import TOUCHED_FRAMES, Features
from iprt.world.world import World


def cone_defines(features: Features) -> dict[str, Define]:
    """`-D` variants of kernels that trace cones."""
    return {
        "OPENING_ENVIRONMENT": features.opening_environment,
        "TOUCHED_FRAMES": TOUCHED_FRAMES,
    }


class ConeReal(RealTracer):
    """Cones from real surfaces, through the voxels of the objects and of what is around them."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        name: str,
        voxels: VoxelWorld,
        cones: int,
        kernel: str = "cone_real",
    ) -> None:
        self._voxels = voxels
        defines = plane_defines() | cone_defines(features)
        super().__init__(device, guide, features, kernel, defines, name=name, cones=cones)

    def arguments(self, world: World) -> dict[str, Any]:
        return self._voxels.arguments()


class ConeVirtual(VirtualTracer):
    """Cones through the voxels of the objects and of the room."""

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
            HAS_DIFFUSE=features.diffuse_signal,
            HAS_SPECULAR=features.specular_signal,
            DELTA=voxels.delta is not None,
            **cone_defines(features),
        )
        super().__init__(device, guide, features, "cone_virtual", defines, cones=cones)

    def arguments(self, world: World) -> dict[str, Any]:
        return self._voxels.arguments() | {"materials": world.objects.materials}


class VoxelConeTracing(SparseMethod):
    """Voxel cone tracing (Rohmer et al. 2017, section 6).

    Attributes
    ----------
    voxels : VoxelWorld
    """

    def __init__(self, setup: Setup) -> None:
        self._own = setup.features.settings.own(VctSettings)
        own = self._own
        self.voxels = GatheringWorld(
            setup.device,
            setup.features,
            method="vct",
            room=own.voxels,
            objects=own.object_voxels,
            anisotropic=own.anisotropic,
        )
        super().__init__(setup)

    def tracers(self) -> Tracers:
        shared: dict[str, Any] = {"voxels": self.voxels, "cones": self._own.cones}
        return Tracers(partial(ConeReal, **shared), partial(ConeVirtual, **shared))

    def trace(self, world: World, context: FrameContext) -> Signals:
        self.voxels.follow(world, self.setup.features)
        return super().trace(world, context)
