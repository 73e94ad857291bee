"""Voxel cone tracing: what cones find in the voxels of the room and of the objects."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.methods.protocol import Setup, Signals
from iprt.methods.sparse import SparseMethod, Tracers
from iprt.methods.trace import RealTracer, VirtualTracer
from iprt.methods.vct import VctSettings
from iprt.methods.voxels import PrefilteredPanorama, Voxels, fitted_grid, room_box
from iprt.settings.features import TOUCHED_FRAMES, Features
from iprt.world.world import World


class VoxelWorld:
    """Room and objects as voxels, and the panorama around them. It follows both.

    Attributes
    ----------
    scene, objects : Voxels
    panorama, outside : PrefilteredPanorama
        What is around the room's voxels, and behind its windows, where the features ask for that.
    """

    def __init__(self, device: ComputeDevice, features: Features, own: VctSettings) -> None:
        self._device = device
        self.scene = Voxels(device, "scene", own.voxels, anisotropic=own.anisotropic)
        self.objects = Voxels(device, "object", own.object_voxels, anisotropic=own.anisotropic)
        openings = features.opening_environment
        self.panorama = PrefilteredPanorama(device, "prefiltered")
        self.outside: PrefilteredPanorama | None = None
        if openings:
            self.outside = PrefilteredPanorama(device, "outside", openings=True)
        voxels = own.object_voxels**3
        self._surface = device.zeros("object voxels surface", (voxels, 4))
        self._facing = device.zeros("object voxels facing", (voxels, 4))
        scene, objects = self.scene, self.objects
        self._voxelize_real = device.kernel(
            "methods/voxelize_real.cl",
            "voxelize_real",
            {"OPENING_ENVIRONMENT": openings},
        ).fixed(levels=scene.levels, opacity=scene.opacity, light=scene.light)
        self._voxelize_objects = device.kernel(
            "methods/voxelize_objects.cl", "voxelize_objects", features.trace_defines()
        ).fixed(
            levels=objects.levels,
            opacity=objects.opacity,
            surface=self._surface,
            facing=self._facing,
        )
        self._light_objects = device.kernel(
            "methods/light_objects.cl", "light_objects", {"OPENING_ENVIRONMENT": openings}
        ).fixed(surface=self._surface, facing=self._facing, light=objects.light)
        self._seen = (0, 0)

    def follow(self, world: World, features: Features) -> None:
        """Follow the video and the objects. Nothing is done if neither has changed."""
        seen = (world.real.version, world.objects.version)
        before, self._seen = self._seen, seen
        if seen == before:
            return
        if seen[0] != before[0]:
            with self._device.profile.section("voxels of the room"):
                self._inject_real(world)
        with self._device.profile.section("voxels of objects"):
            if seen[1] != before[1] or before[1] == 0:
                self._inject_objects(world.arguments(features), world.objects.bounds)
            self._light_objects((self.objects.finest,), self.arguments())
            self.objects.reduce()

    def _inject_real(self, world: World) -> None:
        panorama = world.panorama
        self.panorama.load(panorama)
        if self.outside is not None:
            self.outside.load(panorama)
        box = room_box(world.real.frame.depth, panorama.median_depth)
        scene = self.scene
        scene.place(fitted_grid(*box, scene.resolution))
        self._voxelize_real(
            (scene.finest,),
            self.panorama.arguments(),
            real_width=panorama.width,
            real_height=panorama.height,
            real_surface=panorama.surface,
            box=scene.box,
        )
        scene.reduce()

    def _inject_objects(self, traced: dict[str, Any], bounds: Any) -> None:
        objects = self.objects
        corners = bounds[..., :3].astype(np.float64)
        grid = fitted_grid(corners[:, 0].min(0), corners[:, 1].max(0), objects.resolution)
        objects.place(grid)
        for buffer in (objects.opacity, self._surface, self._facing):
            self._device.fill_zero(buffer)
        x, y, z = grid.size
        for axis, columns in enumerate(((y, z), (z, x), (x, y))):
            self._voxelize_objects(columns, traced, axis=axis, box=objects.box)
        objects.reduce()

    def arguments(self) -> dict[str, Any]:
        """`SCENE_VOXEL_PARAMETERS`, `OBJECT_VOXEL_PARAMETERS` and `SURROUNDINGS_PARAMETERS`."""
        return {
            **self.scene.arguments(),
            **self.objects.arguments(),
            **self.panorama.arguments(),
            **({} if self.outside is None else self.outside.arguments()),
        }


def _cone_defines(features: Features) -> dict[str, Define]:
    """`-D` variants of kernels that trace cones."""
    return {
        "OPENING_ENVIRONMENT": features.opening_environment,
        "TOUCHED_FRAMES": TOUCHED_FRAMES,
    }


class ConeReal(RealTracer):
    """Cones through the voxels of the objects, and of the room behind those that meet one."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        name: str,
        voxels: VoxelWorld,
        own: VctSettings,
    ) -> None:
        self._voxels = voxels
        defines = plane_defines() | _cone_defines(features)
        super().__init__(device, guide, features, "cone_real", defines, name=name, cones=own.cones)

    def arguments(self, world: World) -> dict[str, Any]:
        return self._voxels.arguments()


class ConeVirtual(VirtualTracer):
    """Cones through the voxels of the objects and of the room."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        voxels: VoxelWorld,
        own: VctSettings,
    ) -> None:
        self._voxels = voxels
        defines = guide.defines(
            **dict(features.materials),
            HAS_DIFFUSE=features.diffuse_signal,
            HAS_SPECULAR=features.specular_signal,
            **_cone_defines(features),
        )
        super().__init__(device, guide, features, "cone_virtual", defines, cones=own.cones)

    def arguments(self, world: World) -> dict[str, Any]:
        return self._voxels.arguments() | {"materials": world.objects.materials}


class VoxelConeTracing(SparseMethod):
    """Voxel cone tracing (Rohmer et al. 2017, section 6).

    Attributes
    ----------
    voxels : VoxelWorld
    """

    def __init__(self, setup: Setup) -> None:
        self._own = setup.features.settings.own(VctSettings)
        self.voxels = VoxelWorld(setup.device, setup.features, self._own)
        super().__init__(setup)

    def tracers(self) -> Tracers:
        shared: dict[str, Any] = {"voxels": self.voxels, "own": self._own}
        return Tracers(partial(ConeReal, **shared), partial(ConeVirtual, **shared))

    def trace(self, world: World, context: FrameContext) -> Signals:
        self.voxels.follow(world, self.setup.features)
        return super().trace(world, context)
