"""Virtual objects on the device as layers: traced ones and the visible one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Float4s, Float32
from iprt.device.compute import ComputeDevice
from iprt.gbuffer.batch import Rect, int4
from iprt.gbuffer.guide import plane_defines
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.raster.layers import COVERAGE_TOLERANCE, ObjectLayers
from iprt.world.real.pyramid import GridArgs, Pyramid, PyramidShape, equirect_edges

EMPTY: Rect = (0, 0, 0, 0)


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
    """

    grid: GridArgs
    planes: Float4s
    geometry: Float4s
    material: Float4s
    footprint: Float32


class TracedLayers:
    """Front and back layer of the objects with tangent planes and a depth pyramid.

    Attributes
    ----------
    rect : (x0, y0, x1, y1)
        Pixels covered by objects.
    """

    def __init__(self, device: ComputeDevice, view: View, name: str) -> None:
        self._device = device
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
            plane_defines(equirect=equirect),
        )
        self._pyramid = Pyramid(device)
        self.rect = EMPTY

    def load(self, layers: ObjectLayers, view: cla.Array) -> None:
        """Upload rasterized layers; `view` holds the constants of their view."""
        assert layers.back is not None
        self.rect = covered_rect(layers.front.geometry[..., 3])
        with self._device.profile.section("upload"):
            pair = (layers.front, layers.back)
            self._device.write(self.geometry, np.stack([p.geometry for p in pair]))
            self._device.write(self.material, np.stack([p.material for p in pair]))
        with self._device.profile.section("object surface"):
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


class VisibleSurfaces:
    """Nearest surfaces of the objects, as planes.

    Attributes
    ----------
    normal, depth, id, roughness, albedo, coverage, motion : 3, 1, 1, 1, 3, 1, 2 planes
        See `cl/world/objects/unpack.cl`.
    """

    def __init__(self, device: ComputeDevice, layout: PlaneLayout, *, name: str) -> None:
        """Allocate the planes; `name` prefixes their buffers."""
        self.normal = device.zeros(f"{name} normal", layout.shape(3))
        self.depth = device.zeros(f"{name} depth", layout.shape(1))
        self.id = device.zeros(f"{name} id", layout.shape(1))
        self.roughness = device.zeros(f"{name} roughness", layout.shape(1))
        self.albedo = device.zeros(f"{name} albedo", layout.shape(3))
        self.coverage = device.zeros(f"{name} coverage", layout.shape(1))
        self.motion = device.zeros(f"{name} motion", layout.shape(2))

    def planes(self, prefix: str = "") -> dict[str, cla.Array]:
        """Return all planes by name, as kernel arguments."""
        names = "normal", "depth", "id", "roughness", "albedo", "coverage", "motion"
        return {prefix + name: getattr(self, name) for name in names}


class VisibleLayer(VisibleSurfaces):
    """Nearest surfaces in the view, unpacked from a drawn image.

    Attributes
    ----------
    display : (3, H, W, 4) float32
        The drawn image: `ObjectLayers.display`.
    sides : (H * W, 2) float32
        Share of either real surface that objects hide, in pixels at depth edges.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        edges: Mapping[str, cla.Array],
        *,
        equirect: bool,
    ) -> None:
        """Allocate the planes. `edges` is `RealLayer.edges` of the view, filled before this."""
        super().__init__(device, layout, name="object")
        self._device = device
        self._layout = layout
        self.display = device.empty("object display", (3, layout.height, layout.width, 4))
        self.sides = device.empty("object sides", (layout.height * layout.width, 2))
        self._kernel = device.kernel(
            "world/objects/unpack.cl",
            "unpack_objects",
            plane_defines(equirect=equirect, COVERAGE_TOLERANCE=COVERAGE_TOLERANCE),
        ).fixed(layout.arguments(), self.planes(), edges, display=self.display, sides=self.sides)

    def load(self, layers: ObjectLayers, view: cla.Array, materials: cla.Array) -> None:
        """Upload and unpack layers rasterized with `shade=True`."""
        assert layers.display is not None
        with self._device.profile.section("upload"):
            self._device.write(self.display, layers.display)
        self.unpack(view, materials, [(0, 0, *self._layout.size)])

    def unpack(self, view: cla.Array, materials: cla.Array, regions: Sequence[Rect]) -> None:
        """Fill the planes from `display` in the regions that may have changed."""
        with self._device.profile.section("unpack"):
            for region in regions:
                x0, y0, x1, y1 = region
                self._kernel(
                    (x1 - x0, y1 - y0), rectangle=int4(region), view=view, materials=materials
                )


def covered_rect(image: NDArray[np.float32]) -> Rect:
    """Return the smallest (x0, y0, x1, y1) that contains all positive pixels."""
    rows = np.flatnonzero(image.max(axis=1) > 0.0)
    columns = np.flatnonzero(image.max(axis=0) > 0.0)
    if rows.size == 0:
        return EMPTY
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
