"""The virtual objects on the device as triangles in a bounding volume hierarchy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.scene import INSTANCE_ROWS, STACK, SceneBuilder, scene_sizes, shapes_of
from iprt.bvh.wide import NODE_ROWS
from iprt.device.compute import ComputeDevice, Define
from iprt.scene.material import Material
from iprt.scene.mesh import Instance, motion_between


class ObjectBvh:
    """Buffers of `cl/lib/objects_bvh.h`.

    Parameters
    ----------
    device : ComputeDevice
    instances : sequence of Instance
        They say how large the buffers are; nothing is built before `load`.

    Attributes
    ----------
    motion : (3 M, 4) float32
        Per material of all instances: rows that take world points of its object to where they were
        before the last `load`.

    Raises
    ------
    SceneError
        Too many objects or triangles.
    """

    def __init__(self, device: ComputeDevice, instances: Sequence[Instance]) -> None:
        self._device = device
        self._builder = SceneBuilder()
        materials = [m for instance in instances for m in instance.mesh.materials]
        self._textured = any(m.texture is not None for m in materials)
        sizes = scene_sizes(shapes_of(instances))
        rows = {name: max(count, 1) for name, count in vars(sizes).items()}
        self._count = sizes.instances
        self._nodes = device.empty("bvh nodes", (rows["nodes"], NODE_ROWS, 4))
        self._packets = device.empty("bvh packets", (rows["packets"], 9, 4))
        self._instances = device.empty("bvh instances", (rows["instances"], INSTANCE_ROWS, 4))
        self._triangles = device.empty("bvh triangles", (4 * rows["packets"], 4), np.int32)
        self._normals = device.empty("bvh normals", (rows["vertices"], 4))
        self._uvs = self._texels = None
        table, texels = _albedo_table(materials)
        self._albedos = device.upload("bvh albedos", table)
        self.motion = device.empty("bvh motion", (3 * max(len(materials), 1), 4))
        self._before: Sequence[Instance] | None = None
        if self._textured:
            self._uvs = device.empty("bvh uvs", (rows["vertices"], 2))
            self._texels = device.upload("bvh texels", texels)

    def load(self, instances: Sequence[Instance]) -> None:
        """Follow the objects: transforms and vertices may have changed since the last call.

        While objects move, call it once per frame, and once more when they stop.
        """
        with self._device.profile.host("build bvh"):
            scene = self._builder.build(instances)
        with self._device.profile.section("upload"):
            for buffer, values in (
                (self._nodes, scene.nodes),
                (self._packets, scene.packets),
                (self._instances, scene.instances),
                (self._triangles, scene.triangles),
                (self._normals, scene.normals),
                (self._uvs, scene.uvs),
            ):
                if buffer is not None:
                    # The bound of the number of nodes is not always met.
                    rows = np.zeros(buffer.shape, buffer.dtype)
                    rows[: len(values)] = values
                    self._device.write(buffer, rows)

        moved = [
            motion_between(old.to_world, new.to_world)
            for old, new in zip(self._before or instances, instances, strict=True)
            for _ in new.mesh.materials
        ]
        if moved:
            self._device.write(self.motion, np.concatenate(moved))
        self._before = instances

    def defines(self) -> dict[str, Define]:
        """`-D` variants of kernels that trace the objects."""
        return bvh_defines(textured=self._textured)

    def arguments(self) -> tuple[Any, ...]:
        """What `OBJECT_PARAMETERS` of `cl/lib/objects_bvh.h` declares, up to the objects' boxes."""
        return (
            self._nodes,
            self._packets,
            self._instances,
            self._count,
            self._triangles,
            self._normals,
            self._uvs,
            self._albedos,
            self._texels,
        )


NO_BVH: tuple[Any, ...] = (None, None, None, 0, None, None, None, None, None)
"""In place of `ObjectBvh.arguments()` where a kernel variant traces none."""


def bvh_defines(*, textured: bool) -> dict[str, Define]:
    """`-D` variants of kernels that trace the hierarchy; `textured`: a material has a texture."""
    return {"OBJECTS_BVH": True, "BVH_STACK": STACK, "OBJECT_TEXTURES": textured}


def _albedo_table(
    materials: Sequence[Material],
) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """(2 M, 4) rows of albedo and place of the texture; (T, 4) texels of all textures."""
    table = np.zeros((max(len(materials), 1), 2, 4), np.float32)
    texels: list[NDArray[np.float16]] = []
    first = 0
    for row, material in zip(table, materials, strict=False):
        row[0, :3] = material.albedo
        if material.texture is not None:
            height, width = material.texture.shape[:2]
            row[1].view(np.int32)[:3] = first, width, height
            image = material.texture.reshape(-1, 3).astype(np.float16)
            texels.append(np.pad(image, ((0, 0), (0, 1))))
            first += width * height
    packed = np.concatenate(texels) if texels else np.zeros((1, 4), np.float16)
    return table.reshape(-1, 4), packed
