"""Rays start in front of all real surfaces that the panorama shows."""

from __future__ import annotations

import numpy as np

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.settings.trace import TraceSettings
from tests.kernels.tracing import (
    SURFACE,
    RealTracer,
    build,
    four,
    panorama_of,
    random_directions,
)
from tests.oracles.traverse import FlatLayer
from tests.oracles.worlds import World

ROOM = World()
START_KERNEL = """
#include "maths/grid.h"
#include "world/real/real.h"
__kernel void start(const int n, __global const float4 *point, __global const float4 *normal,
                    __global float4 *origin, const RealLayer layer)
{
    const int i = get_global_id(0);
    if (i < n)
        origin[i].xyz = real_start(layer, point[i].xyz, normal[i].xyz);
}
"""


def test_no_ray_that_starts_on_a_wall_leaves_the_room(device: ComputeDevice) -> None:
    """Also where the texel at an edge shows its wall beyond the next one."""
    panorama = panorama_of(device, ROOM.frame(256, 128))
    plane = FlatLayer.read(device, panorama, 0.05, 0.05).g
    seen = View(512, 256, projection="equirect").directions().reshape(-1, 3)
    column, row = equirect_pixel(seen, 256, 128).astype(int).T
    g = plane[row, column]
    point, inwards = seen / (g * seen).sum(-1, keepdims=True), -g
    inwards /= np.linalg.norm(g, axis=-1, keepdims=True)
    outside = np.maximum(point - ROOM.high, ROOM.low - point).max(-1)
    assert (outside > 0.01).sum() > 100
    start = build(device, START_KERNEL, "start")
    origin = device.empty("origin", (len(seen), 4))
    start(
        (len(seen),),
        layer=panorama.arguments(TraceSettings(thickness=0.05, thickness_ratio=0.05)),
        n=len(seen),
        point=device.upload("point", four(point)),
        normal=device.upload("normal", four(inwards)),
        origin=origin,
    )
    d = random_directions(np.random.default_rng(9), len(seen))
    d *= np.where((d * inwards).sum(-1, keepdims=True) < 0.0, -1.0, 1.0)
    trace = RealTracer(device)
    assert (trace(panorama, device.read(origin)[:, :3], d).kind == SURFACE).all()
