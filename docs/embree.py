"""Time of random rays, against Embree: `python -m docs.embree MESH|SCENE...`.

Needs `embreex` from PyPI. Prints CPU time per ray, in nanoseconds: the least of launches that
alternate with Embree's, for the same rays and triangles. A folder is a scene: rays leave the real
surfaces of its panorama, and Embree has the tangent planes of its texels as two triangles each.
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
from numpy.typing import NDArray

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.geometry.mesh import Instance
from iprt.scene.scene import Scene
from iprt.settings.features import BVH_DEFINES
from iprt.settings.trace import TraceSettings
from iprt.world.objects.object_bvh import ObjectBvh
from iprt.world.real.panorama import Panorama
from tests.bvh.meshes import instance_of
from tests.bvh.rays import rays_at, world_triangles
from tests.kernels.tracing import SURFACE, build, four, panorama_of, random_directions
from tests.meshes import mesh_of

KERNEL = """
#include "world/objects/objects.h"
#include "maths/kernel_attributes.h"
TRACING_KERNEL void trace(const int n, __global const float4 *origin,
                          __global const float4 *direction, __global float *distance,
                          const int any, const Objects world, const Work work)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    ObjectHit hit;
    const int met = trace_objects(world, origin[i].xyz, direction[i].xyz, INFINITY, any, &hit);
    distance[i] = met ? hit.t : INFINITY;
}
"""
MARCH = """
#include "world/real/real.h"
#include "maths/kernel_attributes.h"
TRACING_KERNEL void march(const int n, __global const float4 *origin,
                          __global const float4 *direction, __global float *distance,
                          __global int *kind, const RealLayer layer, const Work work)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    const RealHit hit = trace_real_layer(layer, origin[i].xyz, direction[i].xyz, INFINITY);
    distance[i] = hit.t;
    kind[i] = hit.kind;
}
"""
SURFACE_NONE = constant("lib/world/real/real.h", "SURFACE_NONE")
RAYS, LAUNCHES = 100_000, 30


def compared(device: ComputeDevice, instance: Instance) -> list[float]:
    """Nanoseconds per ray: iprt's closest and any hit, Embree's closest and any hit."""
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

    def ours(query: int) -> None:
        kernel((RAYS,), any=query, **arguments)
        device.queue.finish()

    return least_ns(
        lambda: ours(0),
        lambda: ours(1),
        lambda: scene.run(o, d, output=True),
        lambda: scene.run(o, d, query="OCCLUDED"),
    )


def least_ns(*runs: Callable[[], object]) -> list[float]:
    """Return the least nanoseconds per ray of each of several functions that trace `RAYS`."""
    least = [np.inf] * len(runs)
    for _ in range(LAUNCHES):
        for number, run in enumerate(runs):
            started = time.process_time()
            run()
            least[number] = min(least[number], time.process_time() - started)
    return [1e9 * seconds / RAYS for seconds in least]


# Panoramas ----------------------------------------------------------------------------------


def texel_triangles(panorama: Panorama, width: int, height: int) -> NDArray[np.float32]:
    """Return two triangles for the tangent plane of each texel that shows a surface, (F, 3, 3)."""
    device = panorama.surface.queue
    surface = panorama.surface.get(device).reshape(height, width, 4)
    near_far = panorama.arguments(TraceSettings()).grid.range.get(device)
    low, high = np.moveaxis(near_far.reshape(-1, 2)[: width * height], 1, 0)
    x, y = np.meshgrid(np.arange(width + 1) / width, np.arange(height + 1) / height)
    azimuth, polar = 2.0 * np.pi * x, np.pi * y
    # As in cl/lib/maths/equirect.h.
    edge = np.stack(
        [-np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)], axis=-1
    )
    corners = np.stack([edge[:-1, :-1], edge[:-1, 1:], edge[1:, 1:], edge[1:, :-1]], axis=2)
    inverse = np.einsum("yxkc,yxc->yxk", corners, surface[..., :3])
    limits = [limit.reshape(height, width, 1) for limit in (low, high)]
    with np.errstate(divide="ignore"):
        radius = np.where(inverse > 0.0, np.clip(1.0 / inverse, *limits), limits[1])
    found = (surface[..., 3].astype(int) & SURFACE_NONE) == 0
    points = (corners * radius[..., None])[found]
    return points[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3).astype(np.float32)


def marched(device: ComputeDevice, folder: str) -> tuple[list[float], float, float]:
    """Compare the march of a scene's panorama with Embree.

    Returns
    -------
    times : list of float
        Nanoseconds per ray: iprt's march, Embree's closest hit.
    ended : float
        Share of the rays that end on a visible surface, rather than a side that is assumed.
    agreed : float
        Share of these whose distance is Embree's to 1%.
    """
    frame = Scene.open(Path(folder)).frame()
    panorama = panorama_of(device, frame)
    triangles = texel_triangles(panorama, frame.width, frame.height)
    rng = np.random.default_rng(0)
    of = triangles[rng.integers(len(triangles), size=2 * RAYS)].astype(float)
    normal = np.cross(of[:, 1] - of[:, 0], of[:, 2] - of[:, 0])
    # At the poles triangles have no area.
    chosen = np.flatnonzero(np.linalg.norm(normal, axis=1) > 0.0)[:RAYS]
    normal, centre = normal[chosen], of[chosen].mean(axis=1)
    normal *= -np.sign((normal * centre).sum(1, keepdims=True))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    lift = 2.0 * np.pi / frame.height * np.linalg.norm(centre, axis=1, keepdims=True)
    o = (centre + lift * normal).astype(np.float32)
    d = normal + random_directions(rng, RAYS)
    d = (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)
    kernel = build(device, MARCH, "march")
    distance, kind = device.empty("distance", (RAYS,)), device.empty("kind", (RAYS,), np.int32)
    arguments = {
        "n": RAYS,
        "origin": device.upload("origins", four(o)),
        "direction": device.upload("directions", four(d)),
        "distance": distance,
        "kind": kind,
        "layer": panorama.arguments(TraceSettings()),
    }
    scene = EmbreeScene()
    TriangleMesh(scene, triangles)

    def ours() -> None:
        kernel((RAYS,), **arguments)
        device.queue.finish()

    times = least_ns(ours, lambda: scene.run(o, d, output=True))
    theirs = np.asarray(scene.run(o, d, query="DISTANCE"))
    seen = device.read(kind) == SURFACE
    ratio = device.read(distance)[seen] / theirs[seen]
    return times, float(seen.mean()), float((np.abs(ratio - 1.0) < 0.01).mean())


def main(names: list[str]) -> None:
    device = ComputeDevice(choose_device(None))
    print("| mesh | triangles | closest hit | any hit | Embree: closest hit | Embree: any hit |")
    print("|---|---|---|---|---|---|")
    for file in names:
        if Path(file).is_dir():
            continue
        read = trimesh.load(file, process=False, force="mesh")
        mesh = mesh_of(np.asarray(read.vertices), np.asarray(read.faces))
        times = " | ".join(f"{ns:.0f}" for ns in compared(device, instance_of(mesh)))
        print(f"| {Path(file).stem} | {len(mesh.triangles)} | {times} |")
    print("\n| panorama | march | Embree: closest hit | at visible surfaces | of these, alike |")
    print("|---|---|---|---|---|")
    for folder in filter(lambda name: Path(name).is_dir(), names):
        times, seen, same = marched(device, folder)
        cells = " | ".join([*(f"{ns:.0f}" for ns in times), f"{seen:.1%}", f"{same:.1%}"])
        print(f"| {Path(folder).name} | {cells} |")


if __name__ == "__main__":
    main(sys.argv[1:])
