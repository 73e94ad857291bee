"""Surfaces at the pixels of a picture, read back with it, so that picking never waits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.geometry.pose import view_from
from iprt.renderer import Renderer

Float = NDArray[np.float64]

_THICKNESS = 0.02
"""Largest distance of points from the plane of their surface, as a fraction of depth."""
_FACING = 0.7
"""Least cosine between normals of points on one surface."""
_LEVEL = 0.97
"""Least cosine between the normals of level points and the vertical."""
_RISE = 0.5
"""Largest height of a level part above its edge, as a fraction of the radius."""


@dataclass(frozen=True)
class Surface:
    """A point on a surface, in world space.

    Attributes
    ----------
    depth_m : float
        Distance from the capture centre.
    point, normal : (3,) float64
        Position in metres, and unit normal.
    """

    depth_m: float
    point: Float
    normal: Float


@dataclass(frozen=True, eq=False)
class Geometry:
    """The surfaces visible in a view.

    Attributes
    ----------
    view : View
        World-space view.
    pose : (4, 4) float64 or None
        Transform from the capture centre's axes to the world. The arrays are in these axes.
    names : tuple of str
        Names of the objects.
    real_depth : (H, W) float32
        Metres from the capture centre; +inf in open sky.
    real_normal : (H, W, 3) float32
        Normals of real surfaces.
    depth, normal : (H, W), (H, W, 3) float32
        Depth and normals of objects, valid where `coverage` is not 0.
    coverage : (H, W) float32
        Fraction of the pixel covered by objects.
    material : (H, W) int32
        1 + the index into the concatenated materials of all objects.
    owners : tuple of int
        Index of the object that each material belongs to.
    """

    view: View
    pose: Float | None
    names: tuple[str, ...]
    real_depth: NDArray[np.float32]
    real_normal: NDArray[np.float32]
    depth: NDArray[np.float32]
    normal: NDArray[np.float32]
    coverage: NDArray[np.float32]
    material: NDArray[np.int32]
    owners: tuple[int, ...]

    @classmethod
    def of(cls, renderer: Renderer, instances: Sequence[Instance]) -> Geometry:
        """Read back the surfaces of the last step."""
        layout, read = renderer.layout, renderer.device.read
        real, seen = renderer.real, renderer.visible
        shape = (renderer.view.height, renderer.view.width)

        def planes(buffer: object) -> NDArray[np.float32]:
            image = layout.interior(read(buffer)).astype(np.float32)
            return np.ascontiguousarray(image[0] if len(image) == 1 else np.moveaxis(image, 0, -1))

        nothing = np.zeros(shape, np.float32)
        return cls(
            renderer.view,
            renderer.frame.pose,
            tuple(instance.name for instance in instances),
            planes(real.depth),
            planes(real.normal),
            nothing if seen is None else planes(seen.depth),
            np.zeros((*shape, 3), np.float32) if seen is None else planes(seen.normal),
            nothing if seen is None else planes(seen.coverage),
            (nothing if seen is None else planes(seen.id)).astype(np.int32),
            tuple(n for n, i in enumerate(instances) for _ in i.mesh.materials),
        )

    def object_at(self, x: int, y: int) -> str | None:
        """Return the object that covers most of a pixel, or None for real surfaces."""
        material = int(self.material[y, x])
        if not self.coverage[y, x] > 0.5 or material < 1:
            return None
        return self.names[self.owners[material - 1]]

    def seen(self, x: int, y: int) -> Surface | None:
        """Return the visible surface at a pixel, virtual or real; None for open sky."""
        if self.object_at(x, y) is None:
            return self.real(x, y)
        return self._surface(x, y, float(self.depth[y, x]), self.normal[y, x])

    def real(self, x: int, y: int) -> Surface | None:
        """Return the real surface at a pixel, even behind an object; None for open sky."""
        return self._surface(x, y, float(self.real_depth[y, x]), self.real_normal[y, x])

    def ground(self, x: int, y: int, radius: float, *, upright: bool = False) -> Surface | None:
        """Return the real surface that supports an object at a pixel; None for open sky.

        Depth may be noisy. The normal is therefore the mean over the surface's pixels in the
        neighbourhood, and the position along it their median.

        Parameters
        ----------
        x, y : int
        radius : float
            Radius of the neighbourhood in metres; the eight adjacent pixels always count.
        upright : bool
            Support an upright object: at a rounded edge, the level part beside it does.
        """
        if not np.isfinite(self.real_depth[y, x]):
            return None
        around = np.s_[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        depth = float(np.median(self.real_depth[around][np.isfinite(self.real_depth[around])]))
        direction = view_from(self.view, self.pose).unproject(np.array([x + 0.5, y + 0.5]))
        point, normal = depth * direction, self.real_normal[y, x].astype(np.float64)
        offset = self._real_points - point
        near = np.einsum("...i,...i", offset, offset) < radius**2
        near[around] = True
        near &= (self.real_normal @ normal > _FACING) & (
            np.abs(offset @ normal) < _THICKNESS * self.real_depth
        )
        near[y, x] = True
        normal = self.real_normal[near].mean(axis=0, dtype=np.float64)
        normal /= np.linalg.norm(normal)
        height = float(np.median(offset[near] @ normal))
        placed = point + height * normal
        if upright:
            placed[1] = self._level_beside(x, y, placed, offset, radius)
        return self._in_world(depth, placed, normal)

    def _level_beside(self, x: int, y: int, point: Float, offset: Float, radius: float) -> float:
        """Return the height of the level part of a surface around a point of it, or its own."""
        level = self.real_normal[..., 1] > _LEVEL
        reach = _THICKNESS * float(self.real_depth[y, x])
        # A level point keeps its height; an edge rises to the level part.
        low, high = (-reach, reach) if level[y, x] else (0.0, max(_RISE * radius, reach))
        near = level & (np.hypot(offset[..., 0], offset[..., 2]) < radius)
        near &= (offset[..., 1] >= low) & (offset[..., 1] <= high)
        return float(np.median(self._real_points[near][:, 1]) if near.any() else point[1])

    @cached_property
    def _real_points(self) -> Float:
        """(H, W, 3) points in the axes of the capture centre; very far for open sky."""
        depth = np.minimum(self.real_depth, np.finfo(np.float32).max).astype(np.float64)
        return depth[..., None] * view_from(self.view, self.pose).directions()

    def _surface(self, x: int, y: int, depth: float, normal: NDArray[np.float32]) -> Surface | None:
        if not np.isfinite(depth):
            return None
        pixel = np.array([x + 0.5, y + 0.5])
        direction = view_from(self.view, self.pose).unproject(pixel)
        return self._in_world(depth, depth * direction, normal.astype(np.float64))

    def _in_world(self, depth: float, point: Float, normal: Float) -> Surface:
        if self.pose is not None:
            point = self.pose[:3, :3] @ point + self.pose[:3, 3]
            normal = self.pose[:3, :3] @ normal
        return Surface(depth, point, normal / max(float(np.linalg.norm(normal)), 1e-12))
