"""Inserted objects: their geometry for rays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.bvh.scene import object_bounds
from iprt.device.compute import ComputeDevice
from iprt.device.vectors import int4
from iprt.geometry.camera import View
from iprt.geometry.material import material_table
from iprt.geometry.mesh import Instance, same_places
from iprt.settings.features import Features
from iprt.world.objects.object_bvh import ObjectBvh, ObjectsArgs
from iprt.world.objects.object_layers import EMPTY, TracedLayers
from iprt.world.objects.sunlit import Sunlit
from iprt.world.objects.virtual_lights import VirtualLights

BOX_MARGIN = 1e-3
"""Enlargement of the boxes around objects, as a fraction of their diagonals."""
LAYER_MARGIN = 0.02
"""Enlargement of boxes around rasterized surfaces, whose tangent planes protrude a little."""
MAX_LAYER_ROWS = 1024
"""Most rows of the equirect layers, in which off-screen rays intersect objects."""


class Objects:
    """Objects for rays, as triangles or rasterized layers.

    Attributes
    ----------
    instances : sequence of Instance
        Objects in the axes of the capture centre.
    triangles : ObjectBvh or None
        Hierarchy for all rays that meet triangles; None: none do.
    bvh : ObjectBvh or None
        The same for rays between surfaces; None: these intersect layers.
    screen, around : TracedLayers or None
        Layers of a perspective view, and around the capture centre.
    bounds : (N, 2, 4) float32
        `object_bounds()`; `device_bounds` is its copy on the device, and `bounds_before` the boxes
        before the last move. `materials` is `material_table()`.
    sunlit : Sunlit or None
        Marks of objects that the sun may reach, if the scene has one.
    """

    def __init__(
        self,
        device: ComputeDevice,
        instances: Sequence[Instance],
        view: View,
        rows: int,
        features: Features,
        hierarchy: Callable[[ComputeDevice, Sequence[Instance]], ObjectBvh] = ObjectBvh,
    ) -> None:
        """Create the buffers.

        `rows` are the panorama's. `hierarchy` returns the objects' hierarchy, possibly shared.
        """
        self._device, self.instances = device, instances
        self.screen: TracedLayers | None = None
        self.around: TracedLayers | None = None
        if features.traced_layers:
            layers = TracedLayers(device, view, "screen layers")
            equirect = view.projection == "equirect"
            self.screen, self.around = (None, layers) if equirect else (layers, None)
        if features.equirect_layers:
            rows = min(rows, MAX_LAYER_ROWS)
            everything = View(2 * rows, rows, projection="equirect")
            self.around = TracedLayers(device, everything, "equirect layers")
        # Primary rays need the hierarchy even if other rays intersect layers.
        needed = features.bvh or features.primary_rays
        self.triangles = hierarchy(device, instances) if needed else None
        self.bvh = self.triangles if features.bvh else None
        self._margin = LAYER_MARGIN if features.traced_layers else BOX_MARGIN
        self.bounds = self._bounds()
        self.device_bounds = device.upload("object bounds", self.bounds)
        self.bounds_before = device.upload("object bounds before", self.bounds)
        self.sunlit = Sunlit(device, len(self.bounds), features) if features.sun else None
        self._lights = VirtualLights(device, instances) if features.virtual_lights else None
        materials = material_table([m for i in instances for m in i.mesh.materials])
        self.materials = device.upload("materials", materials)

    def move(self, instances: Sequence[Instance]) -> bool:
        """Move the objects; return False if none has moved."""
        still = same_places(self.instances, instances)
        self.instances = instances
        return not still

    def place(self) -> None:
        """Update the boxes and the hierarchy."""
        self._device.write(self.bounds_before, self.bounds)
        self.bounds = self._bounds()
        self._device.write(self.device_bounds, self.bounds)
        if self.triangles is not None:
            self.triangles.load(self.instances)
        if self._lights is not None:
            self._lights.load(self.instances)

    def _bounds(self) -> NDArray[np.float32]:
        return object_bounds(self.instances, margin=self._margin)

    def arguments(self, view: cla.Array | None) -> ObjectsArgs:
        """Return the objects for rays; `view` holds the constants of the view of `screen`."""
        sunlit = None if self.sunlit is None else self.sunlit.marks
        if self.bvh is not None:
            lights = None if self._lights is None else self._lights.arguments()
            triangles = self.bvh.arguments(self.device_bounds)
            return replace(triangles, sunlit=sunlit, virtual_lights=lights)
        screen, around = self.screen, self.around
        return ObjectsArgs(
            bounds=self.device_bounds,
            count=len(self.bounds),
            sunlit=sunlit,
            screen=screen.arguments() if screen else None,
            equirect=around.arguments() if around else None,
            view=view,
            rectangle=int4(screen.rect if screen else EMPTY),
        )
