"""Relighting of real surfaces outside the view, for reflections."""

from __future__ import annotations

from dataclasses import replace

import pyopencl.array as cla

from iprt.compositing.real_layer import RealLayer
from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Masks
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, Guides, Layer
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.passes import Clock, Pass
from iprt.settings.features import Features
from iprt.trace.pixels import RealPixels
from iprt.trace.tracers import RayKernels
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
        self._view = View(2 * self.rows, self.rows, projection="equirect")
        layout = PlaneLayout.of(self._view)
        self._constants = device.upload("ratio map view", self._view.kernel_constants())
        self._layer = layer = RealLayer(
            device, layout, name="ratio map", radiated=True, camera=camera
        )
        guide = Guide(device, layout, name="ratio map", camera=camera)
        self._guides = Guides(device, [guide], [Layer(layer.normal, layer.depth, layer.id)])
        self._pixels = RealPixels(
            device,
            layer,
            guide,
            features,
            RayKernels.of(features).real,
            name="ratio map",
            min_solid_angle=MIN_SOLID_ANGLE,
        )
        self._masks = Masks(device, [self._pixels.mask])
        self.ratio = self._pixels.relight.ratio
        self._updates = 0

    def passes(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes that update the map, which does not turn with the view."""
        steps = self._pixels.passes(world)

        def resample(_: FrameContext) -> None:
            self._layer.run(world.panorama, self._constants, self._constants)

        def update(context: FrameContext) -> None:
            # A settled map gains little from another frame.
            settled = self._updates >= MAP_SETTLED and not context.changed
            if settled and context.index % MAP_EVERY > 0:
                return
            constants = {"view": self._constants, "previous": self._constants}
            here = replace(context, index=self._updates, **constants)
            self._updates += 1
            self._guides.run(self._constants)
            metre = world.panorama.scale
            self._masks.run(here.grid, [self._layer.motion], metre=metre, cut=context.cut)
            self._pixels.start(here)
            for step in steps:
                step.run(here)

        seen, shown = ("surfaces", "radiated", "camera motion"), ("map surfaces",)
        return [
            Pass("ratio map", Clock.VIDEO, resample, seen, shown),
            Pass("ratio map", Clock.FRAME, update, shown, ("ratio around",)),
        ]
