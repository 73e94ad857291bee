"""Delta voxel cone tracing (Franke 2014)."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.methods.cone_tracing import ConeVirtual, cone_defines
from iprt.methods.delta_world import DeltaWorld
from iprt.methods.dvct import DvctSettings
from iprt.methods.protocol import Setup, Signals
from iprt.methods.sparse import SparseMethod, Tracers
from iprt.methods.trace import traced_arguments
from iprt.settings.features import Features
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World


class DeltaReal:
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
        voxels: DeltaWorld,
        cones: int,
    ) -> None:
        self._device, self._guide, self._voxels = device, guide, voxels
        layout = guide.layout
        self.signal = device.zeros(f"{name} signal", layout.shape(6))
        defines = plane_defines() | cone_defines(features)
        self._kernel = device.kernel("methods/cone_delta.cl", "cone_delta", defines).fixed(
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


class ConeGloss:
    """Reflected objects, less what they hide, at the traced pixels of glossy real surfaces.

    Attributes
    ----------
    change : 3 planes
        Radiance of either sign; valid at the pixels that were traced.
    """

    def __init__(
        self, device: ComputeDevice, guide: Guide, features: Features, *, voxels: DeltaWorld
    ) -> None:
        """Ids of `guide` are indices of the real materials + 1."""
        self._device, self._guide, self._voxels = device, guide, voxels
        self._features = features
        layout = guide.layout
        self.change = device.zeros("gloss signal", layout.shape(3))
        defines = plane_defines() | features.gloss_defines()
        self._kernel = device.kernel("methods/cone_gloss.cl", "cone_gloss", defines).fixed(
            layout.arguments(),
            rays=1,
            frame_seed=features.settings.seed,
            change=self.change,
        )

    def run(self, world: World, mask: Mask, view: cla.Array) -> None:
        """See `iprt.methods.trace.TraceGloss`."""
        layout = self._guide.layout
        with self._device.profile.section("trace gloss"):
            self._kernel(
                (layout.width * layout.height,),
                traced_arguments(self._guide, mask, view),
                world.arguments(self._features),
                self._voxels.arguments(),
            )


class DeltaVoxelConeTracing(SparseMethod):
    """Delta voxel cone tracing (Franke 2014, section 3).

    Attributes
    ----------
    voxels : DeltaWorld
    """

    def __init__(self, setup: Setup) -> None:
        self._own = setup.features.settings.own(DvctSettings)
        self.voxels = DeltaWorld(setup.device, setup.features, self._own)
        super().__init__(setup)

    def tracers(self) -> Tracers:
        shared: dict[str, Any] = {"voxels": self.voxels, "cones": self._own.cones}
        return Tracers(
            partial(DeltaReal, **shared),
            partial(ConeVirtual, **shared),
            partial(ConeGloss, voxels=self.voxels),
        )

    def trace(self, world: World, context: FrameContext) -> Signals:
        self.voxels.follow(world, self.setup.features)
        return super().trace(world, context)
