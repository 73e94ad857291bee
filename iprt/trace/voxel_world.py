"""Voxels of the real surfaces and of the objects, and the panorama around them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.context import FrameContext
from iprt.passes import Clock, Pass
from iprt.settings.features import Features
from iprt.trace.voxels import (
    Float,
    PrefilteredPanorama,
    SurroundingsArgs,
    Voxels,
    fitted_grid,
    room_box,
)
from iprt.world.objects.objects import Objects
from iprt.world.world import World


def box_around(bounds: NDArray[np.float32]) -> tuple[Float, Float]:
    """Return the corners (3,) of the box around boxes (N, 2, 4)."""
    corners = bounds[..., :3].astype(np.float64)
    return corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)


class VoxelWorld(ABC):
    """Room and objects as voxels, and the prefiltered panorama around them.

    Parameters
    ----------
    method : str
        Prefix of buffers' names.
    room, objects : int
        Resolution n of each grid, which has at most n^3 voxels.
    anisotropic : bool
        Coarse voxels have an opacity along each axis.

    Attributes
    ----------
    scene, objects : Voxels
    panorama : PrefilteredPanorama
        Radiance from beyond the room's voxels.
    outside : PrefilteredPanorama or None
        Radiance from behind the room's windows, if the features include it.
    delta : Voxels or None
        Change of the radiance of real surfaces around the objects.
    """

    delta: Voxels | None = None

    def __init__(
        self,
        device: ComputeDevice,
        features: Features,
        *,
        method: str,
        room: int,
        objects: int,
        anisotropic: bool,
    ) -> None:
        self._device = device
        self.scene = Voxels(device, "scene", room, anisotropic=anisotropic, of=method)
        self.objects = Voxels(device, "object", objects, anisotropic=anisotropic, of=method)
        openings = features.opening_environment
        self.panorama = PrefilteredPanorama(device, "prefiltered")
        self.outside: PrefilteredPanorama | None = None
        if openings:
            self.outside = PrefilteredPanorama(device, "outside", openings=True)
        self._surface = device.zeros(f"{method} object voxels surface", (objects**3, 4))
        self._facing = device.zeros(f"{method} object voxels facing", (objects**3, 4))
        scene = self.scene
        self._voxelize_real = device.kernel(
            "trace/voxelize_real.cl",
            "voxelize_real",
            {"OPENING_ENVIRONMENT": openings},
        ).fixed(levels=scene.levels, opacity=scene.opacity, light=scene.light)
        self._voxelize_objects = device.kernel(
            "trace/voxelize_objects.cl", "voxelize_objects", features.trace_defines()
        ).fixed(
            levels=self.objects.levels,
            opacity=self.objects.opacity,
            surface=self._surface,
            facing=self._facing,
        )

    def passes(self, world: World, features: Features) -> list[Pass[FrameContext]]:
        """Return the passes that update the voxels."""

        def inject_objects(_: FrameContext) -> None:
            self._inject_objects(world.objects)

        def light(_: FrameContext) -> None:
            self.light_objects(world, features)
            self.objects.reduce()

        room, objects = "voxels of the room", "voxels of objects"
        seen, lit = ("surfaces", "radiated"), (room, objects)
        return [
            Pass(room, Clock.VIDEO, lambda _: self.inject_real(world), seen, (room,)),
            Pass(objects, Clock.OBJECTS, inject_objects, ("hierarchy",), (objects,)),
            Pass(objects, Clock.OBJECTS, light, lit, ("light of voxels",)),
        ]

    @abstractmethod
    def light_objects(self, world: World, features: Features) -> None:
        """Fill the radiance of the objects' finest level, whose opacity is known."""

    def inject_real(self, world: World) -> None:
        """Fill the room's voxels and the panorama around them from the video's current frame."""
        panorama = world.panorama
        self.panorama.load(panorama)
        if self.outside is not None:
            self.outside.load(panorama)
        box = room_box(world.real.frame.depth, panorama.median_depth)
        scene = self.scene
        scene.place(fitted_grid(*box, scene.resolution))
        self._voxelize_real(
            (scene.finest,),
            panorama=self.panorama.arguments(),
            real_width=panorama.width,
            real_height=panorama.height,
            real_surface=panorama.surface,
            box=scene.box,
        )
        scene.reduce()

    def _inject_objects(self, traced: Objects) -> None:
        objects = self.objects
        objects.place(fitted_grid(*box_around(traced.bounds), objects.resolution))
        grid = objects.grid
        for buffer in (objects.opacity, self._surface, self._facing):
            self._device.fill_zero(buffer)
        x, y, z = grid.size
        for axis, columns in enumerate(((y, z), (z, x), (x, y))):
            self._voxelize_objects(
                columns, objects=traced.arguments(None), axis=axis, box=objects.box
            )
        objects.reduce()

    def arguments(self) -> dict[str, Any]:
        """Return the voxels and their surroundings for cones, by kernel parameter."""
        delta = None if self.delta is None else self.delta.arguments()
        around = SurroundingsArgs(
            panorama=self.panorama.arguments(),
            outside=None if self.outside is None else self.outside.arguments(),
            delta=delta,
        )
        return {
            "scene": self.scene.arguments(),
            "objects": self.objects.arguments(),
            "around": around,
            "delta": delta,
        }
