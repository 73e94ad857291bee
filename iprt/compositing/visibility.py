"""Primary rays: visibility of the objects in the view, in place of the rasterizer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.compositing.object_layer import VisibleLayer
from iprt.device.compute import ComputeDevice
from iprt.device.vectors import int4
from iprt.geometry.camera import View
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Instance, motion_between, row_owners
from iprt.raster.region import Rect, box_corners, box_rects, merge
from iprt.settings.features import BVH_DEFINES
from iprt.world.objects.object_bvh import ObjectBvh
from iprt.world.real.panorama import Panorama

MOTION, FRONT, MATERIAL, FINISH, EMISSION, MET, DISPLACED = BUFFERS = (
    "object motion rows",
    "traced front",
    "traced material",
    "traced finish",
    "traced emission",
    "traced triangles",
    "traced displacement",
)
"""Names of buffers."""


class Visibility:
    """Visibility pass that fills a `VisibleLayer` by tracing primary rays.

    Attributes
    ----------
    motion : (3 M, 4) float32
        Per row of `row_owners`: rows of the map from world points of its object to their
        positions before the last `follow`, without deformation.
    front, material : (H, W, 4) float32
        Planes of the last `run`, before edge pixels borrow surfaces: `iprt.raster.layers.Layer`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        view: View,
        bvh: ObjectBvh,
        instances: Sequence[Instance],
        samples: int,
    ) -> None:
        """Create the buffers for the `instances` of `bvh`; `samples` per pixel side."""
        self._device = device
        self._bvh = bvh
        self._samples = samples
        self._instances: Sequence[Instance] | None = None
        self._owners = row_owners(instances)
        self.motion = device.empty(MOTION, (3 * max(len(self._owners), 1), 4))
        bvh.follow_vertices()
        needs = MaterialNeeds.of(m for instance in instances for m in instance.mesh.materials)
        defines = {**BVH_DEFINES, "WIDE": device.wide, **needs.defines()}
        self._see = device.kernel("compositing/visibility.cl", "see_objects", defines)
        self._show = device.kernel("compositing/visibility.cl", "show_objects", defines)
        self.front = device.empty(FRONT, (view.height, view.width, 4))
        self.material = device.empty(MATERIAL, (view.height, view.width, 4))
        self._finish: cla.Array | None = None
        if needs.principled:
            numbers = 4 if needs.coat_normals else 2
            self._finish = device.empty(FINISH, (view.height, view.width, numbers))
        self._emission: cla.Array | None = None
        if needs.emission:
            self._emission = device.empty(EMISSION, (view.height, view.width, 4))
        self._met = device.empty(MET, (view.height, view.width, 2), np.int32)
        # Output and regions of the last run.
        self._shown: tuple[VisibleLayer, list[Rect]] | None = None
        self._displaced: cla.Array | None = None
        if bvh.deforming:
            self._displaced = device.empty(DISPLACED, (view.height, view.width, 4))

    def follow(self, instances: Sequence[Instance]) -> None:
        """Update the objects' motion.

        Call it before the first `run`, once per frame while they move, and once more. The first
        call sets their positions without motion.
        """
        before = instances if self._instances is None else self._instances
        moved = [
            motion_between(old.to_world, new.to_world)
            for old, new in zip(before, instances, strict=True)
        ]
        if len(self._owners):
            rows = np.array(moved)[self._owners]
            self._device.write(self.motion, rows.reshape(-1, 4))
        self._instances = instances

    def close(self) -> None:
        """Unregister its buffers from the memory account."""
        for name in BUFFERS:
            self._device.buffers.pop(name, None)

    def run(
        self,
        visible: VisibleLayer,
        view: View,
        constants: cla.Array,
        previous: cla.Array,
        panorama: Panorama,
        bounds: NDArray[np.float32],
        boxes: cla.Array,
        materials: cla.Array,
    ) -> None:
        """Trace the view and unpack it into the planes of `visible`.

        Only rectangles around objects, and the regions filled in the last run, are touched.

        Parameters
        ----------
        constants, previous : (16,) float32
            `View.kernel_constants()` of the view and of the previous frame.
        bounds, boxes : (N, 2, 4) float32
            `object_bounds()`, and the same on the device.
        materials : `material_table()` on the device
        """
        seen = {
            "world": self._bvh.arguments(boxes),
            "width": view.width,
            "height": view.height,
            "view": constants,
            "front": self.front,
            "material": self.material,
            "finish": self._finish,
            "emission": self._emission,
            "met": self._met,
            "samples": self._samples,
            "surface": panorama.surface,
            "surface_width": panorama.width,
            "surface_height": panorama.height,
            "displacements": self._bvh.displacements,
            "displaced": self._displaced,
        }
        around = regions_of(view, bounds)
        # A run may be abandoned: then the contents of the planes are unknown.
        last, self._shown = self._shown, None
        known = last is not None and last[0] is visible
        regions = merge(around + last[1]) if last is not None and known else around

        def run(kernel: Callable[..., None], **own: Any) -> None:
            for region in regions:
                kernel(region.viewport[2:], seen, rectangle=int4(region), **own)

        if not known:
            for array in (self.front, self.material, visible.display):
                self._device.fill_zero(array)
        run(self._see)
        run(
            self._show,
            previous=previous,
            moved=self.motion,
            display=visible.display,
        )
        whole = [Rect(0, 0, view.width, view.height)]
        visible.unpack(constants, materials, regions if known else whole)
        self._shown = visible, around


def regions_of(view: View, bounds: NDArray[np.float32]) -> list[Rect]:
    """Return non-empty rectangles around all pixels in which a view can show boxes (N, 2, 4)."""
    seen_at = [box_rects(view, box_corners(low, high)) for low, high in bounds[:, :, :3]]
    return merge([rect for rects in seen_at for rect in rects])
