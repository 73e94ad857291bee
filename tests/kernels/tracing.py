"""Runs the device functions of `cl/lib/` that trace rays, one ray per work item."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.counting import CountingDevice, CountingKernel
from iprt.device.kernel import Kernel
from iprt.device.program import Program
from iprt.device.program import build as build_program
from iprt.device.vectors import int4
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.raster.layers import Layer, ObjectLayers
from iprt.settings.trace import TraceSettings
from iprt.world.objects.object_bvh import ObjectsArgs
from iprt.world.objects.object_layers import EMPTY, TracedLayers
from iprt.world.real.panorama import Panorama
from tests.oracles.worlds import Solid

SURFACE, SIDE, BACK_FACE, SKY, UNKNOWN = range(5)

REAL_KERNEL = """
#include "maths/grid.h"
%s
#include "world/real/real.h"
__kernel void trace(const int n, __global const float4 *origin, __global const float4 *direction,
                    __global float4 *found, __global int4 *what,
                    const RealLayer layer, const Work work)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    RealHit hit = trace_real_layer(layer, origin[i].xyz, direction[i].xyz, INFINITY);
    found[i] = (float4)(hit.direction, hit.t);
    what[i] = (int4)(hit.kind, hit.texel, hit.behind, 0);
}
"""


def build(device: ComputeDevice, source: str, name: str, *options: str) -> Kernel:
    """Compile `source` against `cl/lib/`; on a `CountingDevice` it counts."""
    flags = [*options, *["-DCOUNT_WORK"] * isinstance(device, CountingDevice)]
    defines = ((*flag[2:].split("="), "1")[:2] for flag in flags)
    program = Program.of_text(source, name, dict(defines))
    built = build_program(device.context, program)
    kernel = Kernel(device, lambda: cl.Kernel(built, name), name, name, program.signature(name))
    return CountingKernel(device, kernel) if isinstance(device, CountingDevice) else kernel


def four(vectors: NDArray[np.floating]) -> NDArray[np.float32]:
    """(N, 4) float32 from (N, 3)."""
    return np.concatenate([vectors, np.zeros((len(vectors), 1))], axis=1).astype(np.float32)


@dataclass(frozen=True)
class Hits:
    """Results of `trace_real_layer`: t (N,), kind (N,), texel (N,), direction (N, 3).

    `behind` (N,) tells that it is background which the first layer hides.
    """

    t: NDArray[np.float32]
    kind: NDArray[np.int32]
    texel: NDArray[np.int32]
    behind: NDArray[np.bool_]
    direction: NDArray[np.float32]


class RealTracer:
    """`trace_real_layer` over a panorama."""

    def __init__(
        self,
        device: ComputeDevice,
        *,
        bassrt: bool = False,
        background: bool = False,
        step_cap: int | None = None,
    ) -> None:
        self._device = device
        cap = f"#undef MARCH_STEP_CAP\n#define MARCH_STEP_CAP {step_cap}" if step_cap else ""
        self._bassrt = bassrt
        options = ["-DBACKGROUND"] * background
        self._kernel = build(device, REAL_KERNEL % cap, "trace", *options)

    def __call__(
        self,
        panorama: Panorama,
        origins: NDArray[np.floating],
        directions: NDArray[np.floating],
        thickness: float = 0.05,
        ratio: float = 0.05,
    ) -> Hits:
        """Trace (N, 3) rays; thickness and ratio as in `TraceSettings`."""
        trace = TraceSettings(thickness=thickness, thickness_ratio=ratio, back_faces=self._bassrt)
        device, n = self._device, len(directions)
        found = device.empty("found", (n, 4))
        what = device.empty("what", (n, 4), np.int32)
        self._kernel(
            (n,),
            layer=panorama.arguments(trace),
            n=n,
            origin=device.upload("origins", four(np.broadcast_to(origins, directions.shape))),
            direction=device.upload("directions", four(directions)),
            found=found,
            what=what,
        )
        f, w = device.read(found), device.read(what)
        return Hits(f[:, 3], w[:, 0], w[:, 1], w[:, 2] > 0, f[:, :3])


def random_directions(rng: np.random.Generator, n: int) -> NDArray[np.float32]:
    """(N, 3) uniform unit vectors, rounded to float32."""
    d = rng.normal(size=(n, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def panorama_of(device: ComputeDevice, frame: Frame, *before: Frame) -> Panorama:
    """The frame's panorama, uploaded and built; `before` were seen first and are remembered."""
    trace = TraceSettings() if before else None
    panorama = Panorama(device, frame.width, frame.height, background=trace)
    for shown in (*before, frame):
        panorama.load(shown)
        panorama.remember(forget=False)
    return panorama


OBJECT_KERNEL = """
#include "world/objects/objects.h"
__kernel void trace(const int n, __global const float4 *origin, __global const float4 *direction,
                    __global float *found, __global int2 *what, const Objects world)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    ObjectHit hit;
    const int met = trace_objects(world, origin[i].xyz, direction[i].xyz, INFINITY, 0, &hit);
    found[i] = met ? hit.t : INFINITY;
    what[i] = met ? (int2)(hit.index, hit.on_screen) : (int2)(-1, -1);
}
"""


@dataclass(frozen=True)
class ObjectHits:
    """Results of `trace_objects`: t (N,), inf for a miss; index (N,); on_screen (N,)."""

    t: NDArray[np.float32]
    index: NDArray[np.int32]
    on_screen: NDArray[np.int32]


class ObjectTracer:
    """`trace_objects` over solids whose layers are intersected analytically."""

    def __init__(
        self, device: ComputeDevice, view: View, solids: Sequence[Solid], equirect: View
    ) -> None:
        """Perspective `view`: screen and `equirect` layers. Equirect `view`: these alone."""
        self._device = device
        seen_equirect = view.projection == "equirect"
        flags = ["-DVIEW_EQUIRECT"] if seen_equirect else []
        self._kernel = build(device, OBJECT_KERNEL, "trace", *flags)
        self._view = device.upload("view", view.kernel_constants())
        around = view if seen_equirect else equirect
        self.equirect = TracedLayers(device, around, "equirect")
        self.equirect.load(
            layers_of(solids, around), device.upload("around", around.kernel_constants())
        )
        self.screen = None if seen_equirect else TracedLayers(device, view, "screen")
        if self.screen:
            self.screen.load(layers_of(solids, view), self._view)
        self._bounds = device.upload("bounds", bounds_of(solids))

    def __call__(
        self, origins: NDArray[np.floating], directions: NDArray[np.floating]
    ) -> ObjectHits:
        """Trace (N, 3) rays."""
        device, n = self._device, len(directions)
        found = device.empty("found", (n,))
        what = device.empty("what", (n, 2), np.int32)
        self._kernel(
            (n,),
            n=n,
            origin=device.upload("origins", four(np.broadcast_to(origins, directions.shape))),
            direction=device.upload("directions", four(directions)),
            found=found,
            what=what,
            world=ObjectsArgs(
                bounds=self._bounds,
                count=len(self._bounds),
                screen=self.screen.arguments() if self.screen else None,
                equirect=self.equirect.arguments(),
                view=self._view,
                rectangle=int4(self.screen.rect if self.screen else EMPTY),
            ),
        )
        w = device.read(what)
        return ObjectHits(device.read(found), w[:, 0], w[:, 1])


def layers_of(solids: Sequence[Solid], view: View) -> ObjectLayers:
    """Front and back layers as the rasterizer defines them, with exact depths and normals."""
    d = view.directions()
    shape = (*d.shape[:2], 4)
    front, back = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    nearest = np.full(d.shape[:2], np.inf)
    inside = np.full(d.shape[:2], np.inf)
    for solid in solids:
        t0, t1, n0, n1 = solid.interval(np.zeros(3), d)
        enters = (t0 > 0.0) & (t0 < nearest)
        front[enters] = np.concatenate([n0, t0[..., None]], axis=-1)[enters]
        back[enters] = np.concatenate([n1, t1[..., None]], axis=-1)[enters]
        nearest = np.where(enters, t0, nearest)
        # From within, the first surface is the far side: front and back are the same.
        leaves = (t0 <= 0.0) & (t1 > 0.0) & (t1 < np.minimum(nearest, inside))
        front[leaves] = back[leaves] = np.concatenate([n1, t1[..., None]], axis=-1)[leaves]
        inside = np.where(leaves, t1, inside)
        nearest = np.minimum(nearest, inside)
    blank = np.zeros(shape, np.float32)
    return ObjectLayers(Layer(front, blank), Layer(back, blank))


def bounds_of(solids: Sequence[Solid]) -> NDArray[np.float32]:
    """(N, 2, 4) float32 corners of boxes that hold the solids, as `object_bounds` makes them."""
    bounds = np.zeros((len(solids), 2, 4), np.float32)
    for box, solid in zip(bounds, solids, strict=True):
        low, high = solid.bounds()
        margin = 0.02 * float(np.linalg.norm(high - low))
        box[0, :3], box[1, :3] = low - margin, high + margin
    return bounds
