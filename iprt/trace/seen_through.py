"""Surfaces that a view shows through dielectrics, for motion vectors of their refracted images."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.gbuffer.guide import Guide
from iprt.settings.features import Features
from iprt.trace.tracer_arguments import SurfacesArgs
from iprt.world.world import World

PLANES = constant("lib/trace/seen_through.h", "SEEN_PLANES")


class SeenThrough:
    """Rays of the pixels' centres beyond the dielectrics, of this picture and the previous one.

    Attributes
    ----------
    current : 10 planes
        Origin x y z in metres from the capture centre, direction x y z, distance to the surface
        seen: negative on an object, 0 without dielectric; luminance of the refracted and of the
        reflected image; distance to the reflected surface (`lib/trace/seen_through.h`).
    previous : 10 planes
        The same of the last picture, in its axes. No dielectrics, if it was not run for that one.
    """

    def __init__(self, device: ComputeDevice, guide: Guide, features: Features) -> None:
        self._device, self._guide, self._features = device, guide, features
        self._kernel = device.kernel(
            "trace/see_through.cl", "see_through", features.trace_defines(), later=True
        )
        self.current = device.zeros("seen through", guide.layout.shape(PLANES))
        self.previous = device.zeros("seen through before", guide.layout.shape(PLANES))
        self._index = -1

    def run(self, world: World, surfaces: SurfacesArgs, view: cla.Array, index: int) -> None:
        """Trace the rays of picture number `index`.

        Parameters
        ----------
        surfaces : SurfacesArgs
        view : (16,) float32
            `View.kernel_constants()`.
        """
        self.current, self.previous = self.previous, self.current
        if index != self._index + 1:
            self._device.fill_zero(self.previous)
        self._index = index
        guide = self._guide
        self._kernel(
            guide.layout.size,
            guide.arguments(),
            world=world.arguments(self._features, view),
            surfaces=surfaces,
            seen=self.current,
        )
