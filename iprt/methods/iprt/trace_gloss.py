"""Tracing: what objects change in the reflections of glossy real surfaces."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask
from iprt.gbuffer.guide import Guide
from iprt.methods.trace import traced_arguments
from iprt.settings.features import Features
from iprt.world.world import World


class TraceGloss:
    """Reflected objects, less what they hide, at the traced pixels of glossy real surfaces.

    Attributes
    ----------
    change : 3 planes
        Radiance of either sign; valid at the pixels that were traced.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
    ) -> None:
        """Ids of `guide` are indices of the real materials + 1."""
        self._device = device
        self._guide = guide
        self._features = features
        defines = guide.defines(
            **features.relit_defines(),
            **features.gloss_defines(),
        )
        self._kernel = device.kernel("methods/trace_gloss.cl", "trace_gloss", defines)
        layout = guide.layout
        self.change = device.zeros("gloss signal", layout.shape(3))
        self._samples = device.zeros("gloss samples", layout.shape(1), np.uint32)

    def run(self, world: World, mask: Mask, view: cla.Array) -> None:
        guide, settings = self._guide, self._features.settings
        with self._device.profile.section("trace gloss"):
            self._kernel(
                (guide.layout.width * guide.layout.height,),
                traced_arguments(guide, mask, view, settings.trace.rays, settings.seed),
                world.arguments(self._features),
                samples=self._samples,
                change=self.change,
                touched=mask.touched,
            )
