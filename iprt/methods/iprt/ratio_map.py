"""Relighting of real surfaces outside the view, for reflections."""

from __future__ import annotations

from dataclasses import replace

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Masks
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, Guides, Layer
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.settings.features import Features
from iprt.trace.pixels import RealPixels
from iprt.view.real_layer import RealLayer
from iprt.world.world import World

MIN_SOLID_ANGLE = 0.1
"""Solid angle, sr: surfaces at which the objects subtend less are left as they are."""

MAP_SETTLED, MAP_EVERY = 16, 4
"""Updates after which the map has settled, and period of its updates from then on, in frames, as
long as nothing moves."""


class RatioMap:
    """Relighting ratio of all real surfaces around the capture centre, at low resolution.

    Virtual surfaces reflect real surfaces relit by it where these are outside the view.

    Attributes
    ----------
    rows : int
        Rows of an equirect grid with twice as many columns.
    ratio : (2 * rows * rows, 4) float32
    """

    def __init__(
        self, device: ComputeDevice, features: Features, camera: cla.Array | None = None
    ) -> None:
        """Build the map; `camera` is `CameraMotion.rows`, where the camera moves."""
        self.rows = features.needs.ratio_rows
        self._device = device
        self._view = View(2 * self.rows, self.rows, projection="equirect")
        layout = PlaneLayout.of(self._view)
        self._constants = device.upload("ratio map view", self._view.kernel_constants())
        layer = RealLayer(device, layout, name="ratio map", radiated=True, camera=camera)
        guide = Guide(device, layout, name="ratio map", camera=camera)
        self._guides = Guides(device, [guide], [Layer(layer.normal, layer.depth, layer.id)])
        self._pixels = RealPixels(
            device, layer, guide, features, name="ratio map", min_solid_angle=MIN_SOLID_ANGLE
        )
        self._masks = Masks(device, [self._pixels.mask])
        self.ratio = self._pixels.relight.ratio
        self._updates = 0
        self._follows_camera = camera is not None
        self._in_motion = False

    def run(self, world: World, context: FrameContext) -> None:
        """Update the map; it does not turn with the view and ignores `context.view`."""
        # A settled map gains little from another frame.
        settled = self._updates >= MAP_SETTLED and not context.changed
        if settled and context.index % MAP_EVERY > 0:
            return
        here = replace(context, index=self._updates, view=self._constants, previous=self._constants)
        self._updates += 1
        with self._device.profile.section("ratio map"):
            # The frame after a camera's motion still needs an update: its motion vectors are 0.
            if here.index == 0 or context.changed or self._in_motion:
                self._pixels.layer.run(world.panorama, self._constants, self._constants)
            self._in_motion = self._follows_camera and context.changed
            layer = self._pixels.layer
            self._guides.run(self._constants)
            metre = world.panorama.scale
            self._masks.run(here.grid, [layer.motion], metre=metre, cut=context.cut)
            self._pixels.run(world, here)
