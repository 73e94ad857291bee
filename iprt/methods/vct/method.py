"""Voxel cone tracing (Rohmer et al. 2017)."""

from __future__ import annotations

from dataclasses import replace

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.context import FrameContext
from iprt.method import Setup
from iprt.methods.vct import VctSettings
from iprt.passes import Pass
from iprt.settings.features import Features
from iprt.trace.cones import cones_from_real, cones_from_virtual
from iprt.trace.sparse import SparseMethod
from iprt.trace.tracers import RayKernels
from iprt.trace.voxel_world import VoxelWorld
from iprt.world.world import World


class GatheringWorld(VoxelWorld):
    """Voxels of room and objects in which object voxels gather their light by cones."""

    def __init__(
        self,
        device: ComputeDevice,
        features: Features,
        own: VctSettings,
    ) -> None:
        super().__init__(
            device,
            features,
            method="vct",
            room=own.voxels,
            objects=own.object_voxels,
            anisotropic=own.anisotropic,
        )
        self._gather = device.kernel(
            "methods/vct/light_objects.cl",
            "light_objects",
            {"OPENING_ENVIRONMENT": features.opening_environment},
        ).fixed(surface=self._surface, facing=self._facing, light=self.objects.light)

    def light_objects(self, world: World, features: Features) -> None:
        """Gather the light of the objects' voxels by wide cones."""
        self._gather((self.objects.finest,), self.arguments())


class VoxelConeTracing(SparseMethod):
    """Voxel cone tracing (Rohmer et al. 2017, section 6).

    Attributes
    ----------
    voxels : GatheringWorld
    """

    def __init__(self, setup: Setup) -> None:
        self._own = setup.features.settings.own(VctSettings)
        self.voxels = GatheringWorld(setup.device, setup.features, self._own)
        super().__init__(setup)

    def kernels(self) -> RayKernels:
        """Return the kernels of cones."""
        features, voxels, cones = self.setup.features, self.voxels, self._own.cones
        return replace(
            super().kernels(),
            real=cones_from_real("methods/vct/cone_real", features, voxels, cones),
            virtual=cones_from_virtual(features, voxels, cones),
        )

    def prepare(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes of the voxels."""
        return self.voxels.passes(world, self.setup.features)
