"""Procedural solids, the building blocks of the models.

Units are metres, +Y is up; outsides are counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Solid:
    """Triangles with smooth normals.

    Attributes
    ----------
    positions, normals : (V, 3) float64
    uvs : (V, 2) float64
    triangles : (F, 3) int64
    """

    positions: Float
    normals: Float
    uvs: Float
    triangles: NDArray[np.int64]

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Return the solid translated."""
        return replace(self, positions=self.positions + np.array([x, y, z]))

    def turned(self, axis: str, degrees: float) -> Solid:
        """Return the solid rotated about a coordinate axis through the origin.

        Counter-clockwise, seen from the axis.
        """
        first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        matrix = np.eye(3)
        matrix[first, first] = matrix[second, second] = c
        matrix[first, second], matrix[second, first] = -s, s
        return replace(self, positions=self.positions @ matrix.T, normals=self.normals @ matrix.T)


def join(solids: Sequence[Solid]) -> Solid:
    """Return one solid of the triangles of several."""
    offsets = np.cumsum([0] + [len(solid.positions) for solid in solids[:-1]])
    return Solid(
        np.concatenate([solid.positions for solid in solids]),
        np.concatenate([solid.normals for solid in solids]),
        np.concatenate([solid.uvs for solid in solids]),
        np.concatenate([s.triangles + o for s, o in zip(solids, offsets, strict=True)]),
    )


def sheet(points: Float, *, closed: bool = False) -> Solid:
    """Return a surface through a grid of points (rows, columns, 3).

    Seen from the outside, rows run down and columns to the right. Normals by central differences.

    Parameters
    ----------
    closed : bool
        The last column repeats the first: normals are joined there.
    """
    rows, columns = points.shape[:2]
    along = np.gradient(points, axis=0)
    if closed:
        ring = np.concatenate([points[:, -2:-1], points, points[:, 1:2]], axis=1)
        across = 0.5 * (ring[:, 2:] - ring[:, :-2])
    else:
        across = np.gradient(points, axis=1)
    normals = _unit(np.cross(along, across))
    lost = ~np.isfinite(normals).all(axis=-1) | (np.linalg.norm(normals, axis=-1) < 0.5)
    for row in (0, rows - 1):  # at a pole the ring is a point
        if lost[row].any():
            inner = normals[1 if row == 0 else rows - 2]
            normals[row] = _unit(inner.mean(axis=0, keepdims=True))
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(1, 0, rows))
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    flat = points.reshape(-1, 3)
    area = np.linalg.norm(
        np.cross(
            flat[triangles[:, 1]] - flat[triangles[:, 0]],
            flat[triangles[:, 2]] - flat[triangles[:, 0]],
        ),
        axis=-1,
    )
    return Solid(
        flat, normals.reshape(-1, 3), np.stack([u.ravel(), v.ravel()], -1), triangles[area > 1e-12]
    )


def panel(corner: Sequence[float], right: Sequence[float], up: Sequence[float]) -> Solid:
    """Return a parallelogram with uv (0, 0) at `corner`; its outside is right x up."""
    origin, r, t = (np.asarray(v, np.float64) for v in (corner, right, up))
    normal = _unit(np.cross(r, t))
    return Solid(
        np.stack([origin, origin + r, origin + r + t, origin + t]),
        np.tile(normal, (4, 1)),
        np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )


def box(size: Sequence[float], *, bevel: float = 0.004, steps: int = 2) -> Solid:
    """Return a box around the origin with round edges of radius `bevel`."""
    half = 0.5 * np.asarray(size, np.float64)
    radius = min(bevel, float(half.min()))
    inner = half - radius
    arc = np.tan(np.linspace(0.0, np.pi / 4, steps + 1)) * radius
    lines = [np.concatenate([-i - arc[::-1], i + arc]) for i in inner]
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            grid_a, grid_b = np.meshgrid(lines[a], lines[b], indexing="ij")
            cube = np.empty((*grid_a.shape, 3))
            cube[..., axis], cube[..., a], cube[..., b] = side * half[axis], grid_a, grid_b
            core = np.clip(cube, -inner, inner)
            normal = _unit(cube - core)
            flat = sheet(core + radius * normal)
            uv = np.stack([grid_a / half[a], grid_b / half[b]], -1).reshape(-1, 2) * 0.5 + 0.5
            order = flat.triangles if side > 0 else flat.triangles[:, ::-1]
            faces.append(Solid(flat.positions, normal.reshape(-1, 3), uv, order))
    return join(faces)


def lathe(profile: Sequence[tuple[float, float]], *, segments: int = 64, smooth: int = 0) -> Solid:
    """Return a solid of revolution about +Y.

    Parameters
    ----------
    profile : sequence of (radius, height)
        From the bottom, up the outside (and down an inside, if there is one).
    smooth : int
        Points per span of a Catmull-Rom curve through the profile; 0 keeps the corners sharp.
    """
    points = np.asarray(profile, np.float64)
    if smooth:
        return _revolve(_catmull_rom(points, smooth), segments)
    spans = [points[i : i + 2] for i in range(len(points) - 1)]
    return join([_revolve(span, segments) for span in spans])


def _revolve(profile: Float, segments: int) -> Solid:
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    r, y = profile[::-1, 0:1], profile[::-1, 1:2]
    grid = np.stack(
        [r * np.sin(angle), np.broadcast_to(y, (len(r), len(angle))), r * np.cos(angle)], -1
    )
    solid = sheet(grid, closed=True)
    # Exact normals, poles included: perpendicular to the profile.
    d = (
        np.gradient(profile, axis=0)[::-1]
        if len(profile) > 2
        else np.tile(profile[1] - profile[0], (2, 1))
    )
    normal = np.stack(
        [
            d[:, 1:2] * np.sin(angle),
            np.broadcast_to(-d[:, 0:1], grid.shape[:2]),
            d[:, 1:2] * np.cos(angle),
        ],
        -1,
    )
    return replace(solid, normals=_unit(normal).reshape(-1, 3))


def tube(path: Float, radius: float | Float, *, segments: int = 16, closed: bool = False) -> Solid:
    """Return a round tube along a curve (N, 3), with open ends; `closed` joins its ends.

    The cross-section is carried along without twist (rotation-minimising frames).
    """
    curve = np.asarray(path, np.float64)
    if closed:
        tangent = _unit(np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0))
        curve, tangent = np.vstack([curve, curve[:1]]), np.vstack([tangent, tangent[:1]])
    else:
        tangent = _unit(np.gradient(curve, axis=0))
    side = np.empty_like(curve)
    start = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    side[0] = _unit(start - tangent[0] * (start @ tangent[0]))
    for i in range(1, len(curve)):
        carried = side[i - 1] - tangent[i] * (side[i - 1] @ tangent[i])
        side[i] = carried / np.linalg.norm(carried)
    twist = np.zeros(len(curve))
    if closed:  # the remaining twist of a round trip is spread evenly
        over = np.cross(tangent[0], side[0])
        left = np.arctan2(side[-1] @ over, side[-1] @ side[0])
        twist = -left * np.linspace(0.0, 1.0, len(curve))
    angle = twist[:, None] + np.linspace(0.0, 2.0 * np.pi, segments + 1)
    binormal = np.cross(tangent, side)
    normal = np.cos(angle)[..., None] * side[:, None] + np.sin(angle)[..., None] * binormal[:, None]
    r = np.broadcast_to(np.asarray(radius, np.float64), (len(curve),))
    solid = sheet(curve[:, None] + r[:, None, None] * normal, closed=True)
    # Rows run along the tangent and columns counter-clockwise about it: the outside.
    outward = replace(solid, normals=normal.reshape(-1, 3))
    return _oriented(outward)


def sphere(radius: float, *, segments: int = 48) -> Solid:
    """Return a sphere around the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)
    solid = _revolve(radius * np.stack([np.cos(angle), np.sin(angle)], -1), segments)
    return replace(solid, normals=_unit(solid.positions))


def cylinder(radius: float, height: float, *, bevel: float = 0.003, segments: int = 40) -> Solid:
    """Return an upright cylinder from y = 0 to `height`."""
    b = min(bevel, 0.5 * height, radius)
    return lathe(
        [
            (0, 0),
            (radius - b, 0),
            (radius, b),
            (radius, height - b),
            (radius - b, height),
            (0, height),
        ],
        segments=segments,
    )


def cushion(width: float, depth: float, thickness: float, *, segments: int = 28) -> Solid:
    """Return a pillow lying in the xz plane: two bulging sides that meet in a seam."""
    t = np.sin(np.linspace(-np.pi / 2, np.pi / 2, segments))
    x, z = np.meshgrid(t, t)
    swell = np.sqrt(np.maximum((1 - np.abs(x) ** 3) * (1 - np.abs(z) ** 3), 0.0))
    pinch = 1 - 0.12 * (x**2) * (z**2) + 0.04 * (x**2 + z**2 - 1)
    sides = []
    for sign in (1.0, -1.0):
        grid = np.stack(
            [0.5 * width * x * pinch, sign * 0.5 * thickness * swell, 0.5 * depth * z * pinch], -1
        )
        sides.append(sheet(grid if sign > 0 else grid[:, ::-1]))
    return join(sides)


def torus_knot(p: int, q: int, radius: float, thickness: float, *, segments: int = 240) -> Solid:
    """Return a (p, q) torus knot about +Y."""
    t = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    r = radius * (1.0 + 0.42 * np.cos(q * t))
    path = np.stack([r * np.cos(p * t), 0.42 * radius * np.sin(q * t), r * np.sin(p * t)], -1)
    return tube(path, thickness, segments=24, closed=True)


def write_ply(path: Path, solid: Solid) -> None:
    """Write binary PLY with one float32 normal per vertex; equal vertices are welded."""
    rows = np.concatenate([solid.positions, solid.normals], axis=1).astype("<f4")
    unique, index = np.unique(np.round(rows, 6), axis=0, return_inverse=True)
    faces = index.reshape(-1)[solid.triangles].astype("<i4")
    keep = (
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    )
    packed = np.zeros(int(keep.sum()), dtype=[("n", "u1"), ("v", "<i4", 3)])
    packed["n"], packed["v"] = 3, faces[keep]
    header = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {len(unique)}",
            *(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")),
            f"element face {len(packed)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(header.encode() + unique.astype("<f4").tobytes() + packed.tobytes())


def _catmull_rom(points: Float, steps: int) -> Float:
    ends = np.vstack([2 * points[0] - points[1], points, 2 * points[-1] - points[-2]])
    t = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None]
    curve = [
        0.5
        * (
            2 * b
            + (c - a) * t
            + (2 * a - 5 * b + 4 * c - d) * t**2
            + (3 * b - 3 * c + d - a) * t**3
        )
        for a, b, c, d in zip(ends[:-3], ends[1:-2], ends[2:-1], ends[3:], strict=True)
    ]
    return np.vstack([*curve, points[-1:]])


def _oriented(solid: Solid) -> Solid:
    """Return the solid with every triangle's winding according to its normals."""
    a, b, c = (solid.positions[solid.triangles[:, i]] for i in range(3))
    facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), solid.normals[solid.triangles[:, 0]])
    triangles = np.where((facing < 0)[:, None], solid.triangles[:, ::-1], solid.triangles)
    return replace(solid, triangles=triangles)


def _unit(vectors: Float) -> Float:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 1e-12)
