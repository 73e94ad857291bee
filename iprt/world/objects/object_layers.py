"""Rasterized layers of the objects that rays meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Float4s, Float32
from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.geometry.camera import View
from iprt.raster.layers import ObjectLayers
from iprt.raster.region import Rect
from iprt.world.real.pyramid import GridArgs, Pyramid, PyramidShape, equirect_edges

EMPTY = Rect(0, 0, 0, 0)
SLOPE = constant("lib/world/objects/objects_raster.h", "OBJECT_SLOPE")


@dataclass(kw_only=True)
class ObjectLayerArgs(Block):
    """Layers of objects for rays (`cl/lib/world/objects/objects_raster.h`).

    Attributes
    ----------
    grid : GridArgs
    planes : (H, W, 2, 4) float32
        Front and back: xyz g (g·x = 1 on the tangent plane), w radial distance at the centre, 0:
        nothing.
    geometry : (2, H, W, 4) float32
        Shading normal, radial distance.
    material : (2, H, W, 4) float32
        Albedo, 1 + material index.
    footprint : float
        Of a texel, per metre of distance.
    slope, nearest, farthest : float
        By which share a texel's plane may leave its centre depth, and the factors of that depth.
    """

    grid: GridArgs
    planes: Float4s
    geometry: Float4s
    material: Float4s
    footprint: Float32
    slope: Float32 = 0.0
    nearest: Float32 = 1.0
    farthest: Float32 = 1.0

    def __post_init__(self) -> None:
        slope = np.float32(SLOPE) * np.float32(self.footprint)
        self.slope = float(slope)
        self.nearest, self.farthest = float(1 - slope), float(1 + slope)


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

    def arguments(self) -> ObjectLayerArgs:
        """Return the layers for rays."""
        return ObjectLayerArgs(
            grid=GridArgs(
                width=self.width,
                height=self.height,
                levels=self.shape.levels,
                range=self._range,
                column=self._column,
                row=self._row,
            ),
            planes=self._planes,
            geometry=self.geometry,
            material=self.material,
            footprint=self.footprint,
        )


def covered_rect(image: NDArray[np.float32]) -> Rect:
    """Return the smallest rectangle that contains all positive pixels."""
    rows = np.flatnonzero(image.max(axis=1) > 0.0)
    columns = np.flatnonzero(image.max(axis=0) > 0.0)
    if rows.size == 0:
        return EMPTY
    return Rect(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
