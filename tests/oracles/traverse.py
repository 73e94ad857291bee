"""Brute-force twin of the panorama tracer: every texel on the ray's way, in order, in float64.

No hierarchy, no cells carried along, no skipping: all crossings of a ray with all column meridians
and all row cones are computed and sorted, and the texel of every stretch is that of its midpoint.
The tangent planes, ranges and flags are those that the device built.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.equirect import equirect_pixel
from iprt.settings.trace import TraceSettings
from iprt.world.real.panorama import Panorama

Float = NDArray[np.float64]
Int = NDArray[np.int64]

SURFACE, SIDE, BACK_FACE, SKY, UNKNOWN = range(5)
FRONT, WITHIN, BEHIND = range(3)
EAST, WEST, NORTH, SOUTH, OPENING, NONE = (1 << i for i in range(6))


@dataclass(frozen=True)
class FlatLayer:
    """Level 0 of a panorama, as float64.

    Attributes
    ----------
    g : (H, W, 3) tangent planes, g.x = 1
    flags : (H, W) SURFACE_* bits
    low, high : (H, W) smallest and largest radial distance
    thickness, ratio, bias, farthest : as in `RealLayer`
    """

    g: Float
    flags: Int
    low: Float
    high: Float
    thickness: float
    ratio: float
    bias: float
    farthest: float

    @classmethod
    def read(
        cls, device: ComputeDevice, panorama: Panorama, thickness: float, ratio: float
    ) -> FlatLayer:
        """Read a built panorama back."""
        surface = device.read(panorama.surface).astype(np.float64)
        texels = panorama.width * panorama.height
        range_ = device.read(panorama.range)[:texels].astype(np.float64)
        range_ = range_.reshape(panorama.height, panorama.width, 2)
        given = panorama.arguments(TraceSettings(thickness=thickness, thickness_ratio=ratio))
        return cls(
            surface[..., :3], surface[..., 3].astype(np.int64), range_[..., 0], range_[..., 1],
            given.thickness_m, given.thickness_ratio, given.bias, given.farthest,
        )  # fmt: skip

    def thickness_at(self, r: Float) -> Float:
        return np.maximum(self.thickness, self.ratio * r)


def trace_flat(layer: FlatLayer, o: Float, d: Float) -> tuple[Float, Int, Int]:
    """Trace (N, 3) rays: distance (inf: none), kind and texel (row * W + column; -1: none)."""
    o, d = o.astype(np.float64), d.astype(np.float64)
    parts = [_trace_block(layer, o[i : i + 2048], d[i : i + 2048]) for i in range(0, len(o), 2048)]
    t, kind, texel = (np.concatenate(column) for column in zip(*parts, strict=True))
    return t, kind, texel


def _crossings(layer: FlatLayer, o: Float, d: Float, t_max: Float) -> Float:
    """(N, K) sorted distances where the rays cross any texel edge, with 0 and t_max as ends."""
    height, width = layer.low.shape
    phi = (np.arange(width) / width - 0.5) * 2.0 * np.pi
    normal = np.stack([np.cos(phi), 0.0 * phi, np.sin(phi)])
    nappe = np.cos(np.arange(1, height) / height * np.pi)
    nappe[np.abs(nappe) < 1e-12] = 0.0
    c2 = nappe**2
    with np.errstate(divide="ignore", invalid="ignore"):
        meridians = -(o @ normal) / (d @ normal)
        # Half planes only: `ahead` points along the meridian, away from the axis.
        ahead = np.stack([np.sin(phi), 0.0 * phi, -np.cos(phi)])
        meridians = np.where(o @ ahead + meridians * (d @ ahead) >= 0.0, meridians, np.inf)
        od, oo = (o * d).sum(-1)[:, None], (o * o).sum(-1)[:, None]
        a = d[:, 1:2] ** 2 - c2
        b = o[:, 1:2] * d[:, 1:2] - c2 * od
        c = o[:, 1:2] ** 2 - c2 * oo
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        # The stable pair of roots of a t² + 2 b t + c.
        q = -(b + np.where(b < 0.0, -root, root))
        cones = np.where(b * b >= a * c, np.stack([q / a, c / q]), np.inf)
        height_there = o[:, 1:2] + cones * d[:, 1:2]
        # One nappe only; the equator's cone is a plane and has both.
        cones = np.where(height_there * nappe >= 0.0, cones, np.inf)
    t = np.concatenate([meridians, *cones], axis=1)
    t = np.where((t > 0.0) & (t < t_max[:, None]), t, t_max[:, None])
    ends = np.stack([np.zeros_like(t_max), t_max], axis=1)
    return np.sort(np.concatenate([t, ends], axis=1), axis=1)


def _trace_block(layer: FlatLayer, o: Float, d: Float) -> tuple[Float, Int, Int]:
    height, width = layer.low.shape
    t_max = np.abs((o * d).sum(-1)) + 1.25 * layer.farthest
    edges = _crossings(layer, o, d, t_max)
    walk = _Walk(layer, o, d)
    for k in range(edges.shape[1] - 1):
        t0, t1 = edges[:, k], edges[:, k + 1]
        going = np.flatnonzero((walk.kind < 0) & (t1 - t0 > 1e-12 * t_max))
        if going.size:
            middle = o[going] + (0.5 * (t0 + t1))[going, None] * d[going]
            pixel = equirect_pixel(middle, width, height).astype(np.int64)
            column, row = np.minimum(pixel, [width - 1, height - 1]).T
            walk.visit(going, row, column, t0[going], t1[going])
    left = np.where(walk.side == BEHIND, UNKNOWN, SKY)
    return walk.t, np.where(walk.kind < 0, left, walk.kind), walk.texel


class _Walk:
    """Front, within or behind: the state of every ray, advanced texel by texel."""

    def __init__(self, layer: FlatLayer, o: Float, d: Float) -> None:
        n = len(o)
        self.layer, self.o, self.d = layer, o, d
        self.side = np.full(n, FRONT)
        self.row = np.full(n, -1)
        self.column = np.full(n, -1)
        self.t = np.full(n, np.inf)
        self.kind = np.full(n, -1)
        self.texel = np.full(n, -1)

    def _behind(self, rays: Int, row: Int, column: Int, t: Float) -> tuple[Float, Float]:
        """Return the depth of the rays' points behind the surface, and its thickness there."""
        layer = self.layer
        p = self.o[rays] + t[:, None] * self.d[rays]
        r = np.linalg.norm(p, axis=1)
        gp = (layer.g[row, column] * p).sum(-1)
        low, high = layer.low[row, column], layer.high[row, column]
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = np.where(gp > 0.0, np.minimum(np.maximum(r / gp, low), high), high)
        return r - radius, layer.thickness_at(radius)

    def _connected(self, rays: Int, row: Int, column: Int) -> NDArray[np.bool_]:
        """Is the texel joined with the one that the ray came from?"""
        width = self.layer.low.shape[1]
        flags = self.layer.flags[row, column]
        across = (column - self.column[rays]) % width
        down = row - self.row[rays]
        bit = np.select(
            [across == 1, across == width - 1, down == 1, down == -1], [WEST, EAST, NORTH, SOUTH], 0
        )
        stays = (across == 0) & (down == 0)
        return stays | ((flags & bit) != 0)

    def visit(self, rays: Int, row: Int, column: Int, t0: Float, t1: Float) -> None:
        """Take `rays` from t0 to t1 through the texels (row, column)."""
        layer = self.layer
        side = self.side[rays]
        start = self.row[rays] < 0
        behind0, thick0 = self._behind(rays, row, column, t0)
        behind1, thick1 = self._behind(rays, row, column, t1)
        sky = (layer.flags[row, column] & NONE) != 0
        connected = self._connected(rays, row, column)

        kind = np.full(len(rays), SURFACE)
        crosses = ~start & (side == FRONT) & (behind0 > 0.0)
        kind[crosses & ~connected] = SIDE
        found = crosses & (connected | (behind0 <= thick0))
        from_behind = ~start & (side == BEHIND)
        kind[from_behind] = SIDE
        found |= from_behind & (behind0 <= thick0) & ((behind0 > 0.0) | connected)
        found |= start & (behind0 > 0.0) & (behind0 <= layer.bias) & (behind1 > behind0)
        t = t0.copy()

        leaves = ~start & (side == WITHIN) & (behind0 > thick0)
        side = np.where(start, np.where(behind0 <= thick0, WITHIN, BEHIND), side)
        side[crosses | leaves] = BEHIND
        side[behind0 <= 0.0] = FRONT

        meets = ~found & (side == FRONT) & (behind1 > 0.0)
        kind[meets] = SURFACE
        g = layer.g[row, column]
        with np.errstate(divide="ignore", invalid="ignore"):
            plane = (1.0 - (g * self.o[rays]).sum(-1)) / (g * self.d[rays]).sum(-1)
        t = np.where(meets, np.where((plane >= t0) & (plane <= t1), plane, t1), t)
        enters = ~found & (side == BEHIND) & (behind1 <= thick1)
        kind[enters] = SIDE
        t = np.where(enters, t1, t)
        within = ~found & ~meets & (side == WITHIN)
        after = np.where(behind1 <= 0.0, FRONT, np.where(behind1 > thick1, BEHIND, WITHIN))
        side = np.where(within, after, side)
        found = (found | meets | enters) & ~sky
        side[sky] = FRONT

        self.side[rays], self.row[rays], self.column[rays] = side, row, column
        hit = rays[found]
        self.t[hit], self.kind[hit] = t[found], kind[found]
        self.texel[hit] = (row * layer.low.shape[1] + column)[found]
