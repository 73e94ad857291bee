"""Pixels of glossy real surfaces: what objects change in their reflections."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask, grid_offset
from iprt.filter.signal_filter import SignalFilter
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.gbuffer.layout import PlaneLayout
from iprt.methods.iprt.trace_gloss import TraceGloss
from iprt.settings.features import Features
from iprt.view.real_layer import RealLayer
from iprt.world.world import World


class GlossPixels:
    """Reflections of objects in real surfaces, in place of what they hide from view.

    Attributes
    ----------
    mask : Mask
    change : 3 planes or None
        Radiance to add to what the camera saw, of either sign, filtered; after the first frame.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        features: Features,
        *,
        equirect: bool,
        camera: cla.Array | None = None,
    ) -> None:
        """`camera`: `CameraMotion.rows`, where the camera moves."""
        settings = features.settings
        self._guide = Guide(device, layout, equirect=equirect, name="gloss", camera=camera)
        self.mask = Mask(device, self._guide, settings.mask, name="gloss")
        self._trace = TraceGloss(device, self._guide, features)
        self._filter = SignalFilter(
            device, self._guide, "specular", settings, name="gloss", published=False
        )
        self.change: cla.Array | None = None

    def run(self, world: World, layer: RealLayer, context: FrameContext) -> cla.Array:
        """Trace and filter a frame; `layer` was resampled with gloss."""
        assert layer.gloss is not None
        self._filter.start(context)
        self._guide.run(context.view, layer.normal, layer.depth, layer.gloss)
        self.mask.run(grid_offset(context.index), layer.motion, metre=world.panorama.scale)
        self._trace.run(world, self.mask, context.view)
        self.change = self._filter.run(
            self._trace.change, self.mask, layer.motion, context, roughness=layer.roughness
        )
        return self.change
