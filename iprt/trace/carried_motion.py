"""Motion vectors of the changes that moving objects make to real surfaces."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.temporal import NORMAL_AGREEMENT, PLANE_TOLERANCE
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.world.objects.objects import Objects


class CarriedMotion:
    """Reprojection of shadows and reflections of objects to the previous picture.

    Attributes
    ----------
    carried : 2 planes
        Previous position of the change at each pixel, pixels; -1e9: nowhere.
    """

    def __init__(self, device: ComputeDevice, guide: Guide, *, name: str) -> None:
        self._guide = guide
        self.carried = device.zeros(f"{name} carried motion", guide.layout.shape(2))
        defines = guide.defines(**guide.camera_define)
        kernel = device.kernel("trace/carried_motion.cl", "carry_changes", defines, later=True)
        self._kernel = kernel.fixed(
            guide.layout.arguments(),
            guide.camera_argument,
            plane_tolerance=PLANE_TOLERANCE,
            normal_agreement=NORMAL_AGREEMENT,
            carried=self.carried,
        )

    def run(self, motion: cla.Array, objects: Objects, context: FrameContext) -> cla.Array:
        """Return `carried`; while the objects rest, the surfaces' own `motion`.

        Parameters
        ----------
        motion : 2 planes
            Previous position of each pixel's surface, likewise.
        """
        if not context.moved:
            return motion
        self._kernel(
            self._guide.layout.size,
            guide=self._guide.current,
            guide_previous=self._guide.previous,
            motion=motion,
            bounds=objects.device_bounds,
            bounds_before=objects.bounds_before,
            objects=len(objects.bounds),
            view=context.previous,
        )
        return self.carried
