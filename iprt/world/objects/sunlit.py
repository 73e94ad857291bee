"""Objects that a sun may reach."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.settings.features import Features
from iprt.world.real.panorama import Panorama

FILE = "world/objects/sunlit.cl"
PARTS = constant(FILE, "PARTS")
"""Work items per object."""


class Sunlit:
    """Marks of objects that a sun may reach (`cl/world/objects/sunlit.cl`).

    Attributes
    ----------
    marks : (count,) int32
        1: rays from points in the object's box leave the room towards the sun.
    """

    def __init__(self, device: ComputeDevice, count: int, features: Features) -> None:
        self._device, self._trace = device, features.settings.trace
        self.marks = device.zeros("sunlit objects", (count,), np.int32)
        self._find = device.kernel(
            FILE, "find_sunlit", features.real_defines() | {"SUN": True}, items=PARTS * count
        )

    def find(self, panorama: Panorama, boxes: cla.Array) -> None:
        """Mark the objects; `boxes` is `object_bounds()` on the device."""
        self._device.fill_zero(self.marks)
        objects = boxes.shape[0]
        self._find(
            (PARTS * objects,),
            real=panorama.arguments(self._trace),
            boxes=boxes,
            objects=objects,
            sunlit=self.marks,
        )
