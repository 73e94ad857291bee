"""Delta voxel cone tracing (Franke 2014)."""

from __future__ import annotations

from functools import partial
from typing import Any

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.method import Setup
from iprt.methods.dvct import DvctSettings
from iprt.methods.dvct.delta_world import DeltaWorld
from iprt.passes import Pass
from iprt.settings.features import Features
from iprt.trace.cones import ConeReal, ConeVirtual
from iprt.trace.sparse import SparseMethod, Tracers
from iprt.trace.tracers import GlossTracer
from iprt.world.world import World


class ConeGloss(GlossTracer):
    """Cone of the specular lobe of glossy real surfaces, through the voxels of all volumes."""

    def __init__(
        self, device: ComputeDevice, guide: Guide, features: Features, *, voxels: DeltaWorld
    ) -> None:
        self._voxels = voxels
        defines = plane_defines() | features.gloss_defines()
        super().__init__(device, guide, features, "methods/dvct/cone_gloss", defines, name=None)

    def arguments(self, world: World, view: cla.Array) -> dict[str, Any]:
        """Return the glossy surfaces and the voxels, by kernel parameter."""
        highlight, panorama = world.real.highlight, world.panorama
        assert highlight is not None
        return self._voxels.arguments() | {
            "gloss": highlight.arguments(),
            "real_width": panorama.width,
            "real_height": panorama.height,
        }


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
        """Return the tracers of cones."""
        shared: dict[str, Any] = {"voxels": self.voxels, "cones": self._own.cones}
        return Tracers(
            partial(ConeReal, kernel="methods/dvct/cone_delta", **shared),
            partial(ConeVirtual, **shared),
            partial(ConeGloss, voxels=self.voxels),
        )

    def prepare(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes of the voxels."""
        return self.voxels.passes(world, self.setup.features)
