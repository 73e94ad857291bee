"""Time of random rays at meshes, against Embree: `python -m docs.embree MESH...`.

Needs `embreex` from PyPI. Prints CPU time per ray, in nanoseconds: the least of launches that
alternate with Embree's, for the same rays and triangles.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.geometry.mesh import Instance
from iprt.settings.features import BVH_DEFINES
from iprt.world.objects.object_bvh import ObjectBvh
from tests.bvh.meshes import instance_of
from tests.bvh.rays import rays_at, world_triangles
from tests.kernels.tracing import build, four
from tests.meshes import mesh_of

KERNEL = """
#include "world/objects/objects.h"
#include "maths/kernel_attributes.h"
TRACING_KERNEL void trace(const int n, __global const float4 *origin,
                          __global const float4 *direction, __global float *distance,
                          const Objects world, const Work work)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    ObjectHit hit;
    const int met = trace_objects(world, origin[i].xyz, direction[i].xyz, INFINITY, &hit);
    distance[i] = met ? hit.t : INFINITY;
}
"""
RAYS, LAUNCHES = 100_000, 30


def compared(device: ComputeDevice, instance: Instance) -> tuple[float, float, float]:
    """Nanoseconds per ray: iprt's closest hit, Embree's closest hit and any hit."""
    flags = [f"-D{name}={int(value)}" for name, value in BVH_DEFINES.items()]
    kernel = build(device, KERNEL, "trace", *flags)
    origins, directions = rays_at(instance, RAYS)
    bvh = ObjectBvh(device, [instance])
    bvh.load([instance])
    arguments = {
        "n": RAYS,
        "origin": device.upload("origins", four(origins)),
        "direction": device.upload("directions", four(directions)),
        "distance": device.empty("distance", (RAYS,)),
        "world": bvh.arguments(device.zeros("boxes", (1, 2, 4))),
    }
    scene = EmbreeScene()
    TriangleMesh(scene, world_triangles(instance).astype(np.float32))
    o, d = origins.astype(np.float32), directions.astype(np.float32)

    def ours() -> None:
        kernel((RAYS,), **arguments)
        device.queue.finish()

    runs: list[Callable[[], object]] = [
        ours,
        lambda: scene.run(o, d, output=True),
        lambda: scene.run(o, d, query="OCCLUDED"),
    ]
    least = [np.inf] * len(runs)
    for _ in range(LAUNCHES):
        for number, run in enumerate(runs):
            started = time.process_time()
            run()
            least[number] = min(least[number], time.process_time() - started)
    ours_s, closest_s, any_s = (1e9 * seconds / RAYS for seconds in least)
    return ours_s, closest_s, any_s


def main(files: list[str]) -> None:
    device = ComputeDevice(choose_device(None))
    print("| mesh | triangles | closest hit | Embree: closest hit | Embree: any hit |")
    print("|---|---|---|---|---|")
    for file in files:
        read = trimesh.load(file, process=False, force="mesh")
        mesh = mesh_of(np.asarray(read.vertices), np.asarray(read.faces))
        times = " | ".join(f"{ns:.0f}" for ns in compared(device, instance_of(mesh)))
        print(f"| {Path(file).stem} | {len(mesh.triangles)} | {times} |")


if __name__ == "__main__":
    main(sys.argv[1:])
