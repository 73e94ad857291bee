"""Rays against the hierarchy of a scene through `trace_objects` and `object_point`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.scene import SceneBuilder
from iprt.device.compute import ComputeDevice
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Instance
from iprt.settings.features import BVH_DEFINES
from iprt.world.objects.object_bvh import ObjectBvh
from tests.kernels.tracing import build, four

KERNEL = """
#include "world/objects/objects.h"
#if defined(__has_attribute)
#if __has_attribute(intel_vec_len_hint)
__attribute__((intel_vec_len_hint(1)))
#endif
#endif
__kernel void trace(const int n, __global const float4 *origin, __global const float4 *direction,
                    __global const float *t_max, __global float *distance, __global int2 *what,
                    __global float4 *point, const int any, const Objects world, const Work work)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    ObjectHit hit;
    const int met = trace_objects(world, origin[i].xyz, direction[i].xyz, t_max[i], any, &hit);
    distance[i] = met ? hit.t : INFINITY;
    what[i] = met ? (int2)(hit.instance, hit.triangle) : (int2)(-1);
    point[4 * i] = point[4 * i + 1] = point[4 * i + 2] = point[4 * i + 3] = (float4)(0.0f);
    if (!met)
        return;
    const RayCone line = {0.0f, 0.0f};
    const Scatterer at = object_point(world, hit, origin[i].xyz, direction[i].xyz, line);
    const ObjectSurface surface = object_surface(world, hit, direction[i].xyz, line);
    point[4 * i] = (float4)(at.position, at.material);
    point[4 * i + 1] = (float4)(at.normal, 0.0f);
    point[4 * i + 2] = (float4)(at.albedo, 0.0f);
    point[4 * i + 3] = (float4)(surface.flat_normal, 0.0f);
}
"""


@dataclass(frozen=True)
class Met:
    """Results of rays, one row each.

    Attributes
    ----------
    t : (N,) float32
        inf: nothing.
    instance, triangle : (N,) int
        Numbers within the scene and within the mesh; -1: nothing.
    position, normal, flat_normal, albedo : (N, 3) float32
    material : (N,) int
    """

    t: NDArray[np.float32]
    instance: NDArray[np.int32]
    triangle: NDArray[np.int32]
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    flat_normal: NDArray[np.float32]
    albedo: NDArray[np.float32]
    material: NDArray[np.int32]


class BvhTracer:
    """`trace_objects` over instances, which may move from call to call of `load`."""

    def __init__(
        self, device: ComputeDevice, instances: Sequence[Instance], *, scalar: bool = False
    ) -> None:
        """`scalar`: one child and one triangle after another, as on GPUs."""
        self._device = device
        self._bvh = ObjectBvh(device, instances)
        self._boxes = device.zeros("boxes", (1, 2, 4))
        needs = MaterialNeeds.of(m for instance in instances for m in instance.mesh.materials)
        flags = [f"-D{name}={int(value)}" for name, value in BVH_DEFINES.items()]
        flags += ["-DTEXTURES"] * needs.textures
        self._kernel = build(device, KERNEL, "trace", *flags, *["-DBVH_SCALAR"] * scalar)
        self._builder = SceneBuilder()
        self.load(instances)

    def load(self, instances: Sequence[Instance]) -> None:
        self._bvh.load(instances)
        self.scene = self._builder.build(instances)

    def __call__(
        self,
        origins: NDArray[np.floating],
        directions: NDArray[np.floating],
        t_max: NDArray[np.floating] | float = np.inf,
        *,
        any_hit: bool = False,
    ) -> Met:
        """Trace (N, 3) rays to the nearest hit, or to any."""
        device, n = self._device, len(directions)
        reach = np.broadcast_to(np.float32(t_max), (n,))
        distance = device.empty("distance", (n,))
        what = device.empty("what", (n, 2), np.int32)
        point = device.empty("point", (n, 4, 4))
        self._kernel(
            (n,),
            n=n,
            any=int(any_hit),
            origin=device.upload("origins", four(np.broadcast_to(origins, directions.shape))),
            direction=device.upload("directions", four(directions)),
            t_max=device.upload("reach", reach),
            distance=distance,
            what=what,
            point=point,
            world=self._bvh.arguments(self._boxes),
        )
        found, at = device.read(what), device.read(point)
        met = found[:, 0] >= 0
        instance, triangle = np.full(n, -1, np.int32), np.full(n, -1, np.int32)
        instance[met] = self.scene.instance_of[found[met, 0]]
        triangle[met] = self.scene.slots[found[met, 1]]
        return Met(
            device.read(distance),
            instance,
            triangle,
            at[:, 0, :3],
            at[:, 1, :3],
            at[:, 3, :3],
            at[:, 2, :3],
            at[:, 0, 3].astype(np.int32),
        )
