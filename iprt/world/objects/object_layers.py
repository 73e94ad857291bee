"""Rasterized layers of the objects that rays meet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.raster.layers import ObjectLayers
from iprt.raster.region import Rect
from iprt.world.real.pyramid import Pyramid, PyramidShape, equirect_edges

EMPTY = Rect(0, 0, 0, 0)


class TracedLayers:
    """Front and back layer of the objects with tangent planes and a depth pyramid.

    Attributes
    ----------
    view : View
    rect : Rect
        Pixels covered by objects.
    """

    def __init__(self, device: ComputeDevice, view: View, name: str) -> None:
        self._device, self.view = device, view
        self.width, self.height = view.width, view.height
        equirect = view.projection == "equirect"
        self.footprint = np.pi / view.height if equirect else 1.0 / view.focal_px
        self.shape = PyramidShape.of(self.width, self.height, 8 if equirect else 1)
        layers = (2, self.height, self.width, 4)
        self.geometry = device.empty(f"{name} geometry", layers)
        self.material = device.empty(f"{name} material", layers)
        self._planes = device.empty(f"{name} planes", (self.height, self.width, 2, 4))
        self._range = device.empty(f"{name} range", (self.shape.offsets[-1], 2))
        column, row = equirect_edges(self.width, self.height) if equirect else (None, None)
        self._column = None if column is None else device.upload(f"{name} column", column)
        self._row = None if row is None else device.upload(f"{name} row", row)
        self._build = device.kernel(
            "world/objects/object_surface.cl",
            "build_object_surface",
            {"VIEW_EQUIRECT": equirect},
        )
        self._pyramid = Pyramid(device)
        self.rect = EMPTY

    def load(self, layers: ObjectLayers, view: cla.Array) -> None:
        """Upload rasterized layers; `view` holds the constants of their view."""
        assert layers.back is not None
        self.rect = covered_rect(layers.front.geometry[..., 3])
        pair = (layers.front, layers.back)
        self._device.write(self.geometry, np.stack([p.geometry for p in pair]))
        self._device.write(self.material, np.stack([p.material for p in pair]))
        self._build(
            (self.width, self.height),
            width=self.width,
            height=self.height,
            footprint=self.footprint,
            view=view,
            geometry=self.geometry,
            planes=self._planes,
            range=self._range,
        )
        self._pyramid.run(self._range, self.shape)

    def arguments(self, name: str) -> dict[str, Any]:
        """Return `LAYER_PARAMETERS(name)` of `cl/lib/world/objects/objects_raster.h`."""
        return {
            f"{name}_width": self.width,
            f"{name}_height": self.height,
            f"{name}_levels": self.shape.levels,
            f"{name}_footprint": self.footprint,
            f"{name}_range": self._range,
            f"{name}_column": self._column,
            f"{name}_row": self._row,
            f"{name}_planes": self._planes,
            f"{name}_geometry": self.geometry,
            f"{name}_material": self.material,
        }


def covered_rect(image: NDArray[np.float32]) -> Rect:
    """Return the smallest rectangle that contains all positive pixels."""
    rows = np.flatnonzero(image.max(axis=1) > 0.0)
    columns = np.flatnonzero(image.max(axis=0) > 0.0)
    if rows.size == 0:
        return EMPTY
    return Rect(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
