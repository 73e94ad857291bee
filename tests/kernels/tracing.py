"""Runs the device functions of `cl/lib/` that trace rays, one ray per work item."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice, Kernel
from iprt.passes.panorama import Panorama
from iprt.resources import CL

SURFACE, SIDE, BACK_FACE, SKY, UNKNOWN = range(5)

REAL_KERNEL = """
#include "grid.h"
%s
#include "scene.h"
__kernel void trace(const int n, __global const float4 *origin, __global const float4 *direction,
                    __global float4 *found, __global int2 *what, REAL_PARAMETERS)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    RealLayer layer = REAL_LAYER;
    RealHit hit = trace_real_layer(layer, origin[i].xyz, direction[i].xyz, INFINITY);
    found[i] = (float4)(hit.direction, hit.t);
    what[i] = (int2)(hit.kind, hit.texel);
}
"""


def build(device: ComputeDevice, source: str, name: str, *options: str) -> Kernel:
    """Compile `source` against `cl/lib/`."""
    flags = ["-cl-std=CL1.2", "-I", str(CL / "lib"), *options]
    return Kernel(device, cl.Kernel(cl.Program(device.context, source).build(flags), name))


def four(vectors: NDArray[np.floating]) -> NDArray[np.float32]:
    """(N, 4) float32 from (N, 3)."""
    return np.concatenate([vectors, np.zeros((len(vectors), 1))], axis=1).astype(np.float32)


@dataclass(frozen=True)
class Hits:
    """What `trace_real_layer` returned: t (N,), kind (N,), texel (N,), direction (N, 3)."""

    t: NDArray[np.float32]
    kind: NDArray[np.int32]
    texel: NDArray[np.int32]
    direction: NDArray[np.float32]


class RealTracer:
    """`trace_real_layer` over a panorama."""

    def __init__(
        self, device: ComputeDevice, *, bassrt: bool = False, step_cap: int | None = None
    ) -> None:
        self._device = device
        cap = f"#undef MARCH_STEP_CAP\n#define MARCH_STEP_CAP {step_cap}" if step_cap else ""
        self._kernel = build(device, REAL_KERNEL % cap, "trace", *(["-DBASSRT"] * bassrt))

    def __call__(
        self,
        panorama: Panorama,
        origins: NDArray[np.floating],
        directions: NDArray[np.floating],
        thickness: float = 0.05,
        ratio: float = 0.05,
    ) -> Hits:
        """Trace (N, 3) rays; thickness as in `Panorama.layer_arguments`."""
        device, n = self._device, len(directions)
        found = device.empty("found", (n, 4))
        what = device.empty("what", (n, 2), np.int32)
        self._kernel(
            (n,),
            n,
            device.upload("origins", four(np.broadcast_to(origins, directions.shape))),
            device.upload("directions", four(directions)),
            found,
            what,
            *panorama.layer_arguments(thickness, ratio),
            panorama.color,
        )
        f, w = device.read(found), device.read(what)
        return Hits(f[:, 3], w[:, 0], w[:, 1], f[:, :3])


def random_directions(rng: np.random.Generator, n: int) -> NDArray[np.float32]:
    """(N, 3) uniform unit vectors, rounded to float32."""
    d = rng.normal(size=(n, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def panorama_of(device: ComputeDevice, frame: Any) -> Panorama:
    """The frame's panorama, uploaded and built."""
    panorama = Panorama(device, frame.width, frame.height)
    panorama.load(frame)
    return panorama
