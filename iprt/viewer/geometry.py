"""Surfaces at the pixels of a picture, read with it, so that pointing never waits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance
from iprt.geometry.pose import view_from
from iprt.renderer import Renderer

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """A point of a surface, in the world.

    Attributes
    ----------
    depth_m : float
        Distance from the capture centre.
    point, normal : (3,) float64
        Metres; unit vector.
    """

    depth_m: float
    point: Float
    normal: Float


@dataclass(frozen=True, eq=False)
class Geometry:
    """The surfaces that a view shows.

    Attributes
    ----------
    view : View
        In the world.
    pose : (4, 4) float64 or None
        World from the axes of the capture centre, in which all below is.
    names : tuple of str
        Names of the objects.
    real_depth : (H, W) float32
        Metres from the capture centre; +inf in open sky.
    real_normal : (H, W, 3) float32
    depth, normal : as those
        Depth and normals of objects, where `coverage` is not 0.
    coverage : (H, W) float32
        Share of the pixel that objects cover.
    material : (H, W) int32
        1 + the index of the material among those of all objects, one after the other.
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
        """The surfaces of the last step."""
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
        """Name of the object that covers most of a pixel; None: real surfaces do."""
        material = int(self.material[y, x])
        if not self.coverage[y, x] > 0.5 or material < 1:
            return None
        return self.names[self.owners[material - 1]]

    def seen(self, x: int, y: int) -> Surface | None:
        """The surface at a pixel, of an object or not; None: open sky."""
        if self.object_at(x, y) is None:
            return self.real(x, y)
        return self._surface(x, y, float(self.depth[y, x]), self.normal[y, x])

    def real(self, x: int, y: int) -> Surface | None:
        """The real surface at a pixel, be it behind an object; None: open sky.

        Things are dropped there.
        """
        return self._surface(x, y, float(self.real_depth[y, x]), self.real_normal[y, x])

    def _surface(self, x: int, y: int, depth: float, normal: NDArray[np.float32]) -> Surface | None:
        if not np.isfinite(depth):
            return None
        pixel = np.array([x + 0.5, y + 0.5])
        direction = view_from(self.view, self.pose).unproject(pixel)
        point, facing = depth * direction, normal.astype(np.float64)
        if self.pose is not None:
            point = self.pose[:3, :3] @ point + self.pose[:3, 3]
            facing = self.pose[:3, :3] @ facing
        return Surface(depth, point, facing / max(float(np.linalg.norm(facing)), 1e-12))
