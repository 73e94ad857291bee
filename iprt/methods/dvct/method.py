"""Delta voxel cone tracing (Franke 2014)."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.gbuffer.context import FrameContext
from iprt.method import Setup
from iprt.methods.dvct import DvctSettings
from iprt.methods.dvct.delta_world import DeltaWorld
from iprt.passes import Pass
from iprt.trace.cones import cones_from_real, cones_from_virtual
from iprt.trace.sparse import SparseMethod
from iprt.trace.tracers import RayKernel, RayKernels
from iprt.world.world import World


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

    def kernels(self) -> RayKernels:
        """Return the kernels of cones."""
        features, voxels, cones = self.setup.features, self.voxels, self._own.cones

        def glossy(world: World, _: cla.Array) -> dict[str, Any]:
            highlight, panorama = world.real.highlight, world.panorama
            assert highlight is not None
            return voxels.arguments() | {
                "gloss": highlight.arguments(),
                "real_width": panorama.width,
                "real_height": panorama.height,
            }

        return RayKernels(
            cones_from_real("methods/dvct/cone_delta", features, voxels, cones),
            cones_from_virtual(features, voxels, cones),
            RayKernel("methods/dvct/cone_gloss", features.gloss_defines(), glossy),
        )

    def prepare(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes of the voxels."""
        return self.voxels.passes(world, self.setup.features)
