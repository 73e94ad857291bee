"""Volumes of delta voxel cone tracing: radiance of objects, antiradiance of real surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from iprt.device.block import Block, Float2s, Float4s, Int32
from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.methods.dvct import DvctSettings
from iprt.methods.dvct.area_lights import aimed, area_lights
from iprt.settings.features import Features
from iprt.trace.voxel_world import VoxelWorld, box_around
from iprt.trace.voxels import Float, Voxels, fitted_grid
from iprt.world.world import World

CELL_LEVEL = 2
"""Level of the prefiltered panorama whose cells the lights are made from: 64 rows."""
LIGHT_ROWS = constant("methods/dvct/area_lights.h", "AREA_LIGHT_ROWS")
AROUND = 2.0
"""Side of the cubic volume around objects, relative to the longest side of their box (Franke,
section 3.2)."""


@dataclass(kw_only=True)
class AreaLightsArgs(Block):
    """Area lights and their shadow maps (`cl/methods/dvct/area_lights.h`).

    Attributes
    ----------
    rows : (lights, LIGHT_ROWS, 4) float32
    maps : (lights, side, side, 2) float32
        Distance to the nearest object and to the nearest real surface, metres.
    count : int
    side : int
        Texels of a map.
    """

    rows: Float4s
    maps: Float2s
    count: Int32
    side: Int32


class DeltaWorld(VoxelWorld):
    """Voxels of room and objects, with area lights from the panorama and their shadow maps.

    Attributes
    ----------
    lights : (N, 4, 4) float32
        Rows of `AreaLight` in `cl/methods/dvct/area_lights.h`; the first `light_count` are valid.
    light_count : int
    maps : (N, map_side, map_side, 2) float32
        Shadow maps of the lights.
    delta : Voxels
        Real surfaces around the objects; their radiance is the change by the objects.
    """

    delta: Voxels

    def __init__(self, device: ComputeDevice, features: Features, own: DvctSettings) -> None:
        super().__init__(
            device,
            features,
            method="dvct",
            room=own.room_voxels,
            objects=own.voxels,
            anisotropic=own.anisotropic,
        )
        self.delta = Voxels(device, "delta", own.voxels, anisotropic=own.anisotropic, of="dvct")
        width, height, *_ = self.panorama.levels[CELL_LEVEL].tolist()
        self._cells = device.zeros("area light cells", (height, width, 2, 4))
        self.lights = device.zeros("area lights", (own.lights, LIGHT_ROWS, 4))
        self.light_count, self._own = 0, own
        self._behind: Float | None = None
        self._discs = np.zeros((0, LIGHT_ROWS - 1, 4), np.float32)
        side = own.map_side
        self.maps = device.zeros("area light maps", (own.lights, side, side, 2))
        self._find = device.kernel("methods/dvct/light_cells.cl", "light_cells").fixed(
            level=CELL_LEVEL, cells=self._cells
        )
        self._map = device.kernel(
            "methods/dvct/shadow_maps.cl", "shadow_maps", features.trace_defines()
        ).fixed(area_lights=self.lights, map_side=side, maps=self.maps)
        self._inject_objects_light = device.kernel(
            "methods/dvct/inject_objects.cl", "inject_objects"
        ).fixed(surface=self._surface, facing=self._facing, light=self.objects.light)
        self._inject_change = device.kernel("methods/dvct/inject_real.cl", "inject_real").fixed(
            levels=self.delta.levels, opacity=self.delta.opacity, light=self.delta.light
        )

    def inject_real(self, world: World) -> None:
        """Fill the room's voxels, and make area lights of the panorama."""
        super().inject_real(world)
        self._find(self._cells.shape[1::-1], self._panorama_arguments(world))
        cells = self._device.read(self._cells).astype(np.float64)
        self._discs = area_lights(
            cells[..., 0, :3],
            cells[..., 0, 3],
            cells[..., 1, :3],
            cells[..., 1, 3],
            self._own.lights,
            world.panorama.farthest,
        )
        if self.outside is not None:
            self._behind = self.outside.level(CELL_LEVEL)

    def light_objects(self, world: World, features: Features) -> None:
        """Draw the shadow maps, light the objects' voxels, and fill `delta`."""
        low, high = box_around(world.objects.bounds)
        self._aim(low, high)
        if self.light_count:
            self._map(
                (self._own.map_side**2, self.light_count),
                real=world.panorama.arguments(features.settings.trace),
                objects=world.objects.arguments(None),
                area_light_count=self.light_count,
            )
        arguments = self.arguments()
        self._inject_objects_light((self.objects.finest,), arguments)
        middle, reach = 0.5 * (low + high), 0.5 * AROUND * float((high - low).max())
        delta = self.delta
        delta.place(fitted_grid(middle - reach, middle + reach, delta.resolution))
        self._inject_change(
            (delta.finest,), arguments, self._panorama_arguments(world), box=delta.box
        )
        delta.reduce()

    def _aim(self, low: Float, high: Float) -> None:
        """Aim the lights' maps at the box around the objects."""
        rows = np.zeros(self.lights.shape, np.float32)
        self.light_count = len(self._discs)
        rows[: self.light_count] = aimed(self._discs, low, high, self._behind)
        self._device.write(self.lights, rows)

    def _panorama_arguments(self, world: World) -> dict[str, Any]:
        panorama = world.panorama
        return {
            "panorama": self.panorama.arguments(),
            "real_width": panorama.width,
            "real_height": panorama.height,
            "real_surface": panorama.surface,
        }

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of `VoxelWorld` and the area lights, by kernel parameter."""
        lights = AreaLightsArgs(
            rows=self.lights, maps=self.maps, count=self.light_count, side=self._own.map_side
        )
        return super().arguments() | {"lights": lights}
