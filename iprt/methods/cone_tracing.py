"""Voxel cone tracing: what cones find in the voxels of the room and of the objects."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.filter.mask import Mask
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.methods.protocol import Setup, Signals
from iprt.methods.sparse import SparseMethod, Tracers
from iprt.methods.trace import traced_arguments
from iprt.methods.vct import VctSettings
from iprt.methods.voxel_world import GatheringWorld, VoxelWorld
from iprt.settings.features import TOUCHED_FRAMES, Features
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World


def cone_defines(features: Features) -> dict[str, Define]:
    """`-D` variants of kernels that trace cones."""
    return {
        "OPENING_ENVIRONMENT": features.opening_environment,
        "TOUCHED_FRAMES": TOUCHED_FRAMES,
    }


class ConeReal:
    """What objects change in the irradiance of real surfaces, at the traced pixels of a layer.

    Attributes
    ----------
    signal : 6 planes
        Valid at the pixels that were traced: irradiance that objects hide, and that they send,
        over E_R.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        name: str,
        voxels: VoxelWorld,
        cones: int,
    ) -> None:
        self._device, self._guide, self._voxels = device, guide, voxels
        layout = guide.layout
        self.signal = device.zeros(f"{name} signal", layout.shape(6))
        defines = plane_defines() | cone_defines(features)
        self._kernel = device.kernel("methods/cone_real.cl", "cone_real", defines).fixed(
            layout.arguments(),
            rays=features.settings.trace.rays,
            frame_seed=features.settings.seed,
            cones=cones,
            samples=device.zeros(f"{name} samples", layout.shape(1), np.uint32),
            signal=self.signal,
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        cache: IrradianceCache | None,
        *,
        min_solid_angle: float,
    ) -> None:
        """See `iprt.methods.trace.TraceReal`; objects that look small are not left out."""
        del min_solid_angle
        assert cache is not None
        layout = self._guide.layout
        with self._device.profile.section("trace real"):
            self._kernel(
                (layout.width * layout.height,),
                traced_arguments(self._guide, mask, view),
                self._voxels.arguments(),
                cache.arguments(world.panorama),
            )


class ConeVirtual:
    """Light that visible virtual surfaces reflect, at the traced pixels.

    Attributes
    ----------
    diffuse, specular : 3 planes or None
    hit : 1 plane or None
        As of `iprt.methods.trace.TraceVirtual`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        voxels: VoxelWorld,
        cones: int,
    ) -> None:
        self._device, self._guide, self._voxels = device, guide, voxels
        layout = guide.layout
        self.diffuse = self.specular = self.hit = None
        if features.diffuse_signal:
            self.diffuse = device.zeros("diffuse signal", layout.shape(3))
        if features.specular_signal:
            self.specular = device.zeros("specular signal", layout.shape(3))
            self.hit = device.zeros("specular hit distance", layout.shape(1))
        defines = guide.defines(
            **dict(features.materials),
            HAS_DIFFUSE=features.diffuse_signal,
            HAS_SPECULAR=features.specular_signal,
            DELTA=voxels.delta is not None,
            **cone_defines(features),
        )
        self._kernel = device.kernel("methods/cone_virtual.cl", "cone_virtual", defines).fixed(
            layout.arguments(),
            {"diffuse": self.diffuse, "specular": self.specular, "hit_distance": self.hit},
            rays=features.settings.trace.object_rays,
            frame_seed=features.settings.seed,
            cones=cones,
            samples=device.zeros("object samples", layout.shape(1), np.uint32),
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        albedo: cla.Array,
        history: cla.Array,
    ) -> None:
        """See `iprt.methods.trace.TraceVirtual`; every frame has all cones, whatever `history`."""
        del history
        layout = self._guide.layout
        with self._device.profile.section("trace virtual"):
            self._kernel(
                (layout.width * layout.height,),
                traced_arguments(self._guide, mask, view),
                self._voxels.arguments(),
                albedo=albedo,
                materials=world.objects.materials,
            )


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
