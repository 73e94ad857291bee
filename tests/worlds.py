"""Small scenes for tests of the whole frame: analytic rooms that shine, meshes placed in them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import trimesh
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from tests.meshes import mesh_of, sphere, transform
from tests.oracles.worlds import World, frame_of

Float = NDArray[np.float64]
Radiance = Callable[[Float, Float], Float]
"""Radiance (..., 3) of a room's surface at points (..., 3) with normals (..., 3)."""


def bright_walls(points: Float, normals: Float) -> Float:
    """Return another color for each wall, with gentle waves."""
    axis = np.abs(normals).argmax(-1)
    side = np.take_along_axis(normals, axis[..., None], -1)[..., 0] > 0.0
    left_right = [[0.9, 0.2, 0.2], [0.2, 0.8, 0.3]]
    up_down = [[0.3, 0.3, 0.9], [0.9, 0.8, 0.4]]
    front_back = [[0.6, 0.6, 0.6], [0.2, 0.7, 0.8]]
    colors = np.array(left_right + up_down + front_back)
    waves = 1.0 + 0.1 * np.sin(np.pi * points).sum(-1)
    return np.asarray(colors[2 * axis + side] * waves[..., None])


def ceiling_lamp(points: Float, normals: Float) -> Float:
    """A bright square in the ceiling of a dim room."""
    beside = np.maximum(np.abs(points[..., 0] - 0.2), np.abs(points[..., 2] + 1.4))
    lit = (beside < 0.8) & (normals[..., 1] < -0.5)
    dim = np.where(normals[..., 1] > 0.5, 0.1, 0.2)
    return np.asarray(np.where(lit, 10.0, dim)[..., None] * np.ones(3))


def room_frame(world: World, width: int, height: int, radiance: Radiance) -> Frame:
    """The panorama that the capture centre sees."""
    d = View(width, height, projection="equirect").directions()
    t, normal, _ = world.first_hit(np.zeros(3), d)
    frame = world.frame(width, height)
    return replace(frame, color=radiance(t[..., None] * d, normal).astype(np.float32))


def pose_at(
    position: Sequence[float] = (0.0, 0.0, 0.0), yaw_deg: float = 0.0, pitch_deg: float = 0.0
) -> Float:
    """(4, 4) pose of a camera that stands there and is turned like a view."""
    pose = np.eye(4)
    pose[:3, :3] = View(1, 1, yaw_deg, pitch_deg).world_from_view
    pose[:3, 3] = position
    return pose


def filmed(world: World, width: int, height: int, radiance: Radiance, pose: Float) -> Frame:
    """The panorama that a capture centre with this (4, 4) pose sees, in its own axes."""
    d = View(width, height, projection="equirect").directions() @ pose[:3, :3].T
    t, normal, _ = world.first_hit(pose[:3, 3], d)
    color = radiance(pose[:3, 3] + t[..., None] * d, normal).astype(np.float32)
    return replace(frame_of(t, normal @ pose[:3, :3]), color=color, pose=pose)


def sphere_frame(radius: float, width: int, height: int, radiance: float) -> Frame:
    """The inside of a sphere about the capture centre, with the same light everywhere."""
    d = View(width, height, projection="equirect").directions()
    frame = frame_of(np.full((height, width), radius), -d)
    return replace(frame, color=np.full((height, width, 3), radiance, np.float32))


def landscape_frame(width: int, height: int) -> Frame:
    """A plain, 1.5 m below the capture centre, under an open sky of many colors."""
    d = View(width, height, projection="equirect").directions()
    down = d[..., 1] < 0.0
    depth = np.where(down, -1.5 / np.where(down, d[..., 1], -1.0), np.inf)
    normal = np.broadcast_to([0.0, 1.0, 0.0], d.shape)
    sky = 1.0 + 0.5 * np.sin(3.0 * d)
    frame = frame_of(depth, normal)
    return replace(frame, color=np.where(down[..., None], 0.3, sky).astype(np.float32))


def panorama_at(image: NDArray[np.floating], d: Float) -> Float:
    """Bilinear lookup (..., C) of an equirect image (H, W, C): around the seam, not over a pole."""
    height, width = image.shape[:2]
    column, row = np.moveaxis(equirect_pixel(d, width, height) - 0.5, -1, 0)
    row = np.clip(row, 0.0, height - 1.0)
    x0, y0 = np.floor(column).astype(int), np.floor(row).astype(int)
    fx, fy = (column - x0)[..., None], (row - y0)[..., None]
    y1 = np.minimum(y0 + 1, height - 1)
    upper = image[y0, x0 % width] * (1.0 - fx) + image[y0, (x0 + 1) % width] * fx
    lower = image[y1, x0 % width] * (1.0 - fx) + image[y1, (x0 + 1) % width] * fx
    return np.asarray(upper * (1.0 - fy) + lower * fy)


def keys(x: Float) -> Float:
    """The kernel of cubic convolution (Keys 1981, Eq. 15) with a = -1/2."""
    x = np.abs(x)
    near, far = (1.5 * x - 2.5) * x**2 + 1.0, ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    return np.select([x < 1.0, x < 2.0], [near, far], 0.0)


def panorama_cubic(image: NDArray[np.floating], d: Float) -> Float:
    """Lookup (..., C) like `panorama_at` by cubic convolution, within 5% of the nearest four."""
    height, width = image.shape[:2]
    column, row = np.moveaxis(equirect_pixel(d, width, height) - 0.5, -1, 0)
    row = np.clip(row, 0.0, height - 1.0)
    x0, y0 = np.floor(column).astype(int), np.floor(row).astype(int)
    found = np.zeros((*row.shape, image.shape[-1]))
    low, high = np.full_like(found, np.inf), np.full_like(found, -np.inf)
    for y, x in itertools.product(range(-1, 3), repeat=2):
        texel = image[np.clip(y0 + y, 0, height - 1), (x0 + x) % width]
        found += (keys(column - x0 - x) * keys(row - y0 - y))[..., None] * texel
        if {x, y} <= {0, 1}:
            low, high = np.minimum(low, texel), np.maximum(high, texel)
    return np.asarray(np.clip(found, 0.95 * low, 1.05 * high))


def panorama_in(image: NDArray[np.floating], view: View) -> Float:
    """(H, W, C) of a view: cubic where it is finer than the panorama, else means over pixels."""
    rows = 1.0 / view.focal_px if view.projection == "perspective" else np.pi / view.height
    points = min(int(np.ceil(rows * image.shape[0] / np.pi / 1.5 - 1e-3)), 8)
    if points <= 1:
        return panorama_cubic(image, view.directions())
    x, y = np.meshgrid(np.arange(view.width), np.arange(view.height))
    corners = np.stack([x, y], axis=-1).astype(np.float64)
    offsets = (np.arange(points) + 0.5) / points
    samples = [
        panorama_at(image, view.unproject(corners + offset))
        for offset in itertools.product(offsets, repeat=2)
    ]
    return np.asarray(np.mean(samples, axis=0))


def ball(
    centre: Sequence[float], radius: float, material: Material, *, subdivisions: int = 4
) -> Instance:
    """A sphere with smooth normals."""
    return Instance("ball", sphere(subdivisions, (material,)), transform(radius, centre))


def cuboid(centre: Sequence[float], half: Sequence[float], material: Material) -> Instance:
    """An axis-aligned box with flat faces."""
    shape = trimesh.creation.box(extents=2.0 * np.asarray(half, np.float64))
    corners = shape.triangles.reshape(-1, 3)
    normals = shape.face_normals.repeat(3, axis=0)
    mesh = mesh_of(corners, np.arange(len(corners)), (material,), normals)
    return Instance("box", mesh, transform(1.0, centre))


def disc(
    centre: Sequence[float], radius: float, material: Material, *, corners: int = 128
) -> Instance:
    """A flat horizontal disc without thickness, of the area of a true one."""
    turn = np.arange(corners) * 2.0 * np.pi / corners
    rim = np.stack([np.cos(turn), np.zeros(corners), np.sin(turn)], -1)
    rim *= np.sqrt(2.0 * np.pi / corners / np.sin(2.0 * np.pi / corners))
    positions = np.concatenate([np.zeros((1, 3)), rim])
    first = np.arange(corners)
    faces = np.stack([np.zeros_like(first), 1 + (first + 1) % corners, 1 + first], -1)
    mesh = mesh_of(positions, faces, (material,), (0.0, 1.0, 0.0))
    return Instance("disc", mesh, transform(radius, centre))


def scaled(
    frame: Frame, instances: Sequence[Instance], factor: float
) -> tuple[Frame, list[Instance]]:
    """Return the scene with lengths in another unit."""
    larger = np.diag([factor, factor, factor, 1.0])
    return (
        replace(frame, depth=(frame.depth * np.float32(factor)).astype(np.float32)),
        [replace(i, to_world=larger @ i.to_world) for i in instances],
    )


def turned(
    frame: Frame, instances: Sequence[Instance], columns: int
) -> tuple[Frame, list[Instance], float]:
    """The scene turned to the right by columns of the panorama; and by how many degrees."""
    yaw_deg = columns * 360.0 / frame.width
    turn = np.eye(4)
    turn[:3, :3] = View(1, 1, yaw_deg).world_from_view
    rolled = Frame(
        color=np.roll(frame.color, columns, 1),
        depth=np.roll(frame.depth, columns, 1),
        opening=np.roll(frame.opening, columns, 1),
        normal=(np.roll(frame.normal, columns, 1) @ turn[:3, :3].T).astype(np.float32),
    )
    return rolled, [replace(i, to_world=turn @ i.to_world) for i in instances], yaw_deg


def mirrored(
    frame: Frame, instances: Sequence[Instance], *, meshes: bool
) -> tuple[Frame, list[Instance]]:
    """The scene as a mirror at x = 0 shows it.

    With `meshes`, objects are mirrored triangle by triangle, which are then wound the other way
    round, and their transforms stay proper; else their transforms mirror.
    """
    flip = np.diag([-1.0, 1.0, 1.0, 1.0])
    side = np.array([-1.0, 1.0, 1.0], np.float32)
    flipped = Frame(
        color=frame.color[:, ::-1].copy(),
        depth=frame.depth[:, ::-1].copy(),
        opening=frame.opening[:, ::-1].copy(),
        normal=(frame.normal[:, ::-1] * side).astype(np.float32),
    )
    moved = [replace(i, to_world=flip @ i.to_world) for i in instances]
    if not meshes:
        return flipped, moved
    wound = []
    for instance in moved:
        mesh = instance.mesh
        other = replace(
            mesh,
            positions=mesh.positions * side,
            normals=mesh.normals * side,
            triangles=np.ascontiguousarray(mesh.triangles[:, ::-1]),
        )
        wound.append(replace(instance, mesh=other, to_world=instance.to_world @ flip))
    return flipped, wound
