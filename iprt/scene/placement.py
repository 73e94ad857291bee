"""Real surfaces as points, and placement of objects on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.transform import Rotation

from iprt.errors import SceneError
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_direction, equirect_texel, solid_angles
from iprt.geometry.mesh import Instance, Mesh, transformed
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.walls import Walls

Array = NDArray[np.float64]

UPRIGHT = 0.7
"""Least |y| of the unit normal of a floor or ceiling."""
_SMOOTHING_TEXELS = 9
"""Width of the window over which normals are averaged, in texels: captured depth is noisy."""
_MAX_ROWS = 512
_STEP = 0.02
"""Height difference that separates two surfaces, as a fraction of the camera's height above the
upper one."""
_STRAY = 0.05
"""Largest share of the local solid angle that stray points may have."""
_LEAST_SLANT = 0.01
"""Least sine of the viewing angle of level surfaces, which bounds their area near the horizon."""
_SETTLE = 0.01
"""Gap from which an object counts as floating or sunk, as a fraction of the median depth."""
_DEEP, _LITTLE = 0.5, 5e-3
"""Depth below the floor, as a fraction of the camera's height above it, and share of the sphere. A
deeper surface with a smaller share is more likely a depth error than a place."""
_HIDDEN = 0.95
"""Share of an object's vertices behind real surfaces from which it lies outside the room."""
_VISIBLE = 1e-3
"""Least size over distance of a visible object: a third of a pixel at 60° and 1024 pixels."""


@dataclass(frozen=True)
class SetDown:
    """The result of `set_down`.

    Attributes
    ----------
    to_world : (4, 4) float64
    foot : (3,) float64
        World-space point below the object's middle, at the height of its lowest point.
    fits : bool
        True if the object intersects no wall.
    """

    to_world: Array
    foot: Array
    fits: bool

    def warnings(self) -> list[str]:
        """Return the faults of the placement, one phrase each."""
        if self.fits:
            return []
        return ["cuts a wall: no place that is free is nearer than the object is large"]


class RealSurfaces:
    """The points of a frame's depth map, thinned to at most 512 rows and without openings.

    Attributes
    ----------
    points, normals : (N, 3) float64
        Points in metres, and unit normals averaged over a few texels.
    """

    def __init__(self, frame: Frame) -> None:
        self._frame = frame
        step = max(1, -(-frame.height // _MAX_ROWS))
        rows, columns = np.meshgrid(
            np.arange(0, frame.height, step), np.arange(0, frame.width, step), indexing="ij"
        )
        depth = frame.depth[rows, columns].astype(np.float64)
        kept = np.isfinite(depth) & ~frame.opening[rows, columns]
        pixels: Array = np.stack([columns, rows], axis=-1)[kept].astype(np.float64) + 0.5
        directions: Array = equirect_direction(pixels, frame.width, frame.height)
        self._weights = solid_angles(frame.width, frame.height)[rows[kept]]
        self.points = directions * depth[kept][:, None]
        self._smooth = _smoothed(frame.fitted_normal[rows, columns])
        self.normals = self._smooth[kept]
        # Averages alone would take the foot of a wall for floor; single normals are too noisy.
        upright = (
            np.minimum(frame.fitted_normal[rows, columns][..., 1], self._smooth[..., 1]) > UPRIGHT
        )
        self._upward = upright[kept]
        # Upward-facing points, their spacing, and the area that each represents.
        self._level = self.points[self._upward]
        distance = np.linalg.norm(self._level, axis=1)
        self._apart = step * np.pi / frame.height * distance
        slant = np.maximum(np.abs(self._level[:, 1]) / distance, _LEAST_SLANT)
        self._area = self._weights[self._upward] * distance**2 / slant
        self._step = step

    def hit(self, yaw_deg: float, pitch_deg: float) -> tuple[Array, Array]:
        """Return the point (3,) and normal (3,) of the surface seen in a direction.

        Depth is the median of 3 x 3 texels, which ignores a stray one.

        Raises
        ------
        SceneError
            The panorama has no depth there.
        """
        direction = direction_of(yaw_deg, pitch_deg)
        row, column = equirect_texel(direction, self._frame.width, self._frame.height)
        if not np.isfinite(self._frame.depth[row, column]):
            where = "lower" if pitch_deg > 0.0 else "beside it"
            raise SceneError(
                f"the panorama has no depth at yaw {yaw_deg:g}, pitch {pitch_deg:g} (sky, or a "
                f"hole), and so nothing to stand on; look {where}"
            )
        rows = slice(max(int(row) - 1, 0), int(row) + 2)
        columns = np.arange(int(column) - 1, int(column) + 2) % self._frame.width
        around = self._frame.depth[rows, columns]
        depth = float(np.median(around[np.isfinite(around)]))
        return direction * depth, self._smooth[row // self._step, column // self._step]

    def normal_near(self, point: Array) -> Array:
        """Return the averaged unit normal (3,) of the surface point nearest to a point (3,)."""
        offset = self.points - point
        return np.asarray(self.normals[np.argmin(np.einsum("ij,ij->i", offset, offset))])

    def height_below(self, x: float, z: float, radius: float, top: float) -> float | None:
        """Return y of the highest upward-facing surface around (x, z), not above `top`.

        It is the area-weighted median of that surface, because the highest points would lift
        objects by the noise of depth. Surfaces with a small share of the local solid angle count as
        stray points, however large they would be at their depth.

        Returns
        -------
        float or None
            Metres; None if no such surface is seen.
        """
        offset = self._level[:, [0, 2]] - (x, z)
        near = np.einsum("ij,ij->i", offset, offset) < np.maximum(radius, self._apart) ** 2
        near &= self._level[:, 1] <= top
        heights = self._level[near, 1]
        if heights.size == 0:
            return None
        order = np.argsort(-heights)
        heights, area = heights[order], self._area[near][order]
        seen = self._weights[self._upward][near][order]
        steps = -np.diff(heights, prepend=heights[0])
        surface = np.cumsum(steps > _STEP * max(abs(heights[0]), 1e-6))
        share = np.bincount(surface, seen) / seen.sum()
        highest = surface == np.argmax(share >= min(_STRAY, share.max()))
        heights, area = heights[highest], area[highest]
        return float(np.quantile(heights, 0.5, weights=area, method="inverted_cdf"))

    def floor(self) -> float | None:
        """Return y of the floor, the 20% quantile of upward surfaces by solid angle, or None."""
        if not self._upward.any():
            return None
        heights, weights = self._level[:, 1], self._weights[self._upward]
        return float(np.quantile(heights, 0.2, weights=weights, method="inverted_cdf"))

    def walls(self, centre: Array, reach: float) -> Walls:
        """Return the walls within a horizontal distance of a point (3,), metres."""
        return Walls(self.points, self.normals, centre, reach)

    def placement_faults(self, instance: Instance) -> list[str]:
        """Return the faults of an object's placement, one phrase each."""
        vertices = transformed(instance.to_world, instance.mesh.positions.astype(np.float64))
        row, column = equirect_texel(vertices, self._frame.width, self._frame.height)
        distance = np.linalg.norm(vertices, axis=1)
        nearest = float(distance.min())
        light = instance.mesh.light
        if light is not None:
            hidden = light.kind != "sun" and (distance > self._frame.depth[row, column]).all()
            return ["lies behind the real surfaces, outside the room"] if hidden else []
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        size = high - low
        found = []
        if size.max() < _VISIBLE * nearest:
            found.append(
                f"is {size.max():.2g} m large at a distance of {nearest:.2g} m, too small to be "
                "seen"
            )
        if size.max() > self._room.max():
            return [*found, f"is larger than the room, which is {metres(self._room)}"]
        hidden = np.mean(distance > 1.02 * self._frame.depth[row, column]) > _HIDDEN
        feet = vertices[vertices[:, 1] <= low[1] + 0.02 * size[1]].mean(axis=0)
        radius = 0.25 * float(np.hypot(size[0], size[2]))
        top = low[1] + 0.5 * max(size[1], 0.1 * nearest)
        support = self.height_below(feet[0], feet[2], radius, top)
        if (low < 0.0).all() and (high > 0.0).all():
            found.append("surrounds the capture centre: views look out from inside it")
        elif hidden:
            found.append("lies behind the real surfaces, outside the room")
        elif support is None:
            found.append("stands on nothing that is seen: nothing below it faces up")
        if support is None:
            return found
        if (below := self._doubtful_depth(support)) > 0.0:
            found.append(
                f"stands {below:.2g} m below the floor, on something that fills little of the "
                "panorama; its depth may be wrong there"
            )
        gap = float(low[1] - support)
        if not hidden and abs(gap) > _SETTLE * self._frame.median_depth:
            verb = "floats {} above" if gap > 0.0 else "sinks {} into"
            found.append(f"{verb.format(f'{100 * abs(gap):.1f} cm')} the surface below it")
        return found

    def _doubtful_depth(self, support: float) -> float:
        """Return the depth of a surface below the floor if it may be a depth error, else 0."""
        floor = self.floor()
        if floor is None or not floor < 0.0 or floor - support < _DEEP * -floor:
            return 0.0
        level = np.abs(self._level[:, 1] - support) < _STEP * -support
        share = self._weights[self._upward][level].sum() * self._step**2 / (4.0 * np.pi)
        return floor - support if share < _LITTLE else 0.0

    @cached_property
    def _room(self) -> Array:
        """(3,) size in metres of a box around the points, without outliers."""
        if len(self.points) == 0:
            return np.full(3, np.inf)
        low, high = np.percentile(self.points, (0.1, 99.9), axis=0)
        return np.asarray(high - low)


def direction_of(yaw_deg: float, pitch_deg: float) -> Array:
    """Return the unit direction (3,) from the capture centre, to the right and up of -Z."""
    return -View(1, 1, yaw_deg, pitch_deg).world_from_view[:, 2]


def metres(size: Array) -> str:
    """Format a size, such as `1.20 x 0.85 x 0.40 m`; small or large values get 3 digits."""
    return (
        " x ".join(f"{side:.2f}" if 0.095 <= side < 1000 else f"{side:.3g}" for side in size) + " m"
    )


def bounds(mesh: Mesh, rotation: Array | None = None) -> tuple[Array, Array]:
    """Return the lowest and highest corner, (3,) each, of the triangles of a mesh, or of a light.

    The rotation (3, 3), if given, is applied first.
    """
    used = np.full(len(mesh.positions), mesh.light is not None)
    used[mesh.triangles] = True
    corners = mesh.positions[used].astype(np.float64)
    if rotation is not None:
        corners = corners @ rotation.T
    return corners.min(axis=0), corners.max(axis=0)


def set_down(
    surfaces: RealSurfaces,
    mesh: Mesh,
    yaw_deg: float,
    pitch_deg: float,
    pose: MeshPose,
) -> SetDown:
    """Place an object upright on the surface seen in a direction.

    Floors and tables are used as they are. At a wall, the object goes to the surface at the wall's
    foot and then away from the wall, to the nearest free place within the object's own size. If
    there is none, it stays at the chosen place and intersects the wall.

    Raises
    ------
    SceneError
        There is no depth in that direction or no floor, or the object's size is outside the range
        of `scene.toml`.
    """
    rotation = pose.rotation
    low, high = bounds(mesh, rotation)
    extent = high - low
    point, normal = surfaces.hit(yaw_deg, pitch_deg)
    scale = pose.scale(extent, float(np.linalg.norm(point)))
    radius = 0.5 * scale * float(np.hypot(extent[0], extent[2]))
    base = point.copy()
    if normal[1] <= UPRIGHT:
        wall = normal * (1.0, 0.0, 1.0)
        length = float(np.linalg.norm(wall))
        if length > 1.0 - UPRIGHT:
            base += wall / length * radius
    top = float(point[1]) + 0.02 * float(np.linalg.norm(point))
    base[1] = _support(surfaces, base, radius, top)
    size, height = scale * float(extent.max()), scale * float(extent[1])
    place = surfaces.walls(base, size + radius).free_place(
        base,
        radius,
        height,
        size,
        lambda x, z: surfaces.height_below(x, z, 0.5 * radius, top),
    )
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation
    center = 0.5 * (low + high)
    foot = base if place is None else place
    matrix[:3, 3] = foot - scale * np.array([center[0], low[1], center[2]])
    return SetDown(matrix, foot, fits=place is not None)


def settled(
    surfaces: RealSurfaces, name: str, mesh: Mesh, to_world: Array, *, align: bool
) -> Array:
    """Move an object vertically onto the highest surface that is below its middle.

    Parameters
    ----------
    surfaces : RealSurfaces
    name : str
        Name of the object, for the error.
    mesh : Mesh
    to_world : (4, 4) float64
        Transform to the axes of the capture centre.
    align : bool
        Also align the object's +Y axis with the surface normal.

    Returns
    -------
    (4, 4) float64
        Transform in the same axes.

    Raises
    ------
    SceneError
        No surface is seen below it.
    """
    linear, moved = to_world[:3, :3], to_world[:3, 3]
    low, high = (corner + moved for corner in bounds(mesh, linear))
    size, centre = high - low, 0.5 * (low + high)
    radius = 0.25 * float(np.hypot(size[0], size[2]))
    height = surfaces.height_below(centre[0], centre[2], radius, float(centre[1]))
    height = surfaces.floor() if height is None else height
    if height is None:
        raise SceneError(f"{name}: no surface below it is seen; place it above a floor or table")
    if align:
        point = np.array([centre[0], height, centre[2]])
        return set_on(to_world, bounds(mesh), point, surfaces.normal_near(point))
    placed = to_world.copy()
    placed[1, 3] += height - low[1]
    return placed


def set_on(
    to_world: Array, corners: tuple[Array, Array], point: Array, normal: Array | None = None
) -> Array:
    """Move an object so that it stands on a point of a surface.

    Parameters
    ----------
    to_world : (4, 4) float64
    corners : pair of (3,) float64
        Lowest and highest corner of its mesh (`bounds`).
    point : (3,) float64
        A point of the surface, in the world.
    normal : (3,) float64 or None
        Unit vector to align the object's own +Y with, by the shortest rotation; None keeps the
        object's rotation.

    Returns
    -------
    (4, 4) float64
        Transform with the centre of the object's bottom at `point` and the same scale.
    """
    low, high = corners
    foot = np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])
    placed = to_world.copy()
    if normal is not None:
        up = to_world[:3, 1] / np.linalg.norm(to_world[:3, 1])
        turn, _ = Rotation.align_vectors([normal], [up])
        placed[:3, :3] = turn.as_matrix() @ to_world[:3, :3]
    placed[:3, 3] = point - placed[:3, :3] @ foot
    return placed


def _support(surfaces: RealSurfaces, base: Array, radius: float, top: float) -> float:
    """Return y of the surface below, or of the floor if none is seen (behind furniture)."""
    height = surfaces.height_below(base[0], base[2], 0.5 * radius, top)
    if height is None:
        height = surfaces.floor()
    if height is None:
        raise SceneError("no surface of the scene faces up; there is nothing to stand on")
    return height


def _smoothed(normal: NDArray[np.float32]) -> Array:
    """Average normals (H, W, 3) over a window that wraps around the seam, and normalise them."""
    mean = ndimage.uniform_filter(
        normal.astype(np.float64), _SMOOTHING_TEXELS, mode=("nearest", "wrap"), axes=(0, 1)
    )
    return np.asarray(mean / np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-12))
