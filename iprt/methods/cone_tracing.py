"""Voxel cone tracing: what cones find in the voxels of the room and of the objects."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.filter.mask import Mask
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.methods.protocol import Setup, Signals
from iprt.methods.sparse import SparseMethod, Tracers
from iprt.methods.trace import traced_arguments
from iprt.methods.vct import VctSettings
from iprt.methods.voxels import PrefilteredPanorama, Voxels, fitted_grid, room_box
from iprt.settings.features import TOUCHED_FRAMES, Features
from iprt.world.real.irradiance import IrradianceCache
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


class ConeReal:
    """What objects change in the irradiance of real surfaces, at the traced pixels of a layer.

    Attributes
    ----------
    signal : 6 planes
        Valid at the pixels that were traced: irradiance that objects hide, and that they send,
        over E_R.
    """

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
        self._device, self._guide, self._voxels = device, guide, voxels
        layout = guide.layout
        self.signal = device.zeros(f"{name} signal", layout.shape(6))
        defines = plane_defines() | _cone_defines(features)
        self._kernel = device.kernel("methods/cone_real.cl", "cone_real", defines).fixed(
            layout.arguments(),
            rays=features.settings.trace.rays,
            frame_seed=features.settings.seed,
            cones=own.cones,
            samples=device.zeros(f"{name} samples", layout.shape(1), np.uint32),
            signal=self.signal,
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        cache: IrradianceCache | None,
        *,
        min_solid_angle: float,
    ) -> None:
        """See `iprt.methods.trace.TraceReal`; objects that look small are not left out."""
        del min_solid_angle
        assert cache is not None
        layout = self._guide.layout
        with self._device.profile.section("trace real"):
            self._kernel(
                (layout.width * layout.height,),
                traced_arguments(self._guide, mask, view),
                self._voxels.arguments(),
                cache.arguments(world.panorama),
            )


class ConeVirtual:
    """Light that visible virtual surfaces reflect, at the traced pixels.

    Attributes
    ----------
    diffuse, specular : 3 planes or None
    hit : 1 plane or None
        As of `iprt.methods.trace.TraceVirtual`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        *,
        voxels: VoxelWorld,
        own: VctSettings,
    ) -> None:
        self._device, self._guide, self._voxels = device, guide, voxels
        layout = guide.layout
        self.diffuse = self.specular = self.hit = None
        if features.diffuse_signal:
            self.diffuse = device.zeros("diffuse signal", layout.shape(3))
        if features.specular_signal:
            self.specular = device.zeros("specular signal", layout.shape(3))
            self.hit = device.zeros("specular hit distance", layout.shape(1))
        defines = guide.defines(
            **dict(features.materials),
            HAS_DIFFUSE=features.diffuse_signal,
            HAS_SPECULAR=features.specular_signal,
            **_cone_defines(features),
        )
        self._kernel = device.kernel("methods/cone_virtual.cl", "cone_virtual", defines).fixed(
            layout.arguments(),
            {"diffuse": self.diffuse, "specular": self.specular, "hit_distance": self.hit},
            rays=features.settings.trace.object_rays,
            frame_seed=features.settings.seed,
            cones=own.cones,
            samples=device.zeros("object samples", layout.shape(1), np.uint32),
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        albedo: cla.Array,
        history: cla.Array,
    ) -> None:
        """See `iprt.methods.trace.TraceVirtual`; every frame has all cones, whatever `history`."""
        del history
        layout = self._guide.layout
        with self._device.profile.section("trace virtual"):
            self._kernel(
                (layout.width * layout.height,),
                traced_arguments(self._guide, mask, view),
                self._voxels.arguments(),
                albedo=albedo,
                materials=world.objects.materials,
            )


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
