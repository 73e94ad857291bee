"""Virtual objects on the device as triangles in a bounding volume hierarchy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import DTypeLike

from iprt.bvh.build import PACKET_ROWS
from iprt.bvh.scene import INSTANCE_ROWS, SceneBuilder, scene_sizes, shapes_of
from iprt.bvh.wide import NODE_ROWS
from iprt.device.block import (
    Block,
    Bytes,
    Counters,
    Float2s,
    Float4,
    Float4s,
    Floats,
    Halves,
    Int4,
    Int4s,
    Int32,
    Ints,
    when,
)
from iprt.device.compute import ComputeDevice
from iprt.device.vectors import float4
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Instance, same_places
from iprt.world.objects.lamps import Lamps, LampsArgs
from iprt.world.objects.object_layers import ObjectLayerArgs
from iprt.world.objects.texture_tables import place_table, texture_table, variant_table
from iprt.world.objects.virtual_lights import VirtualLightsArgs


@dataclass(kw_only=True)
class BvhArgs(Block):
    """Objects as triangles in a bounding volume hierarchy (`cl/lib/world/objects/bvh.h`).

    Attributes
    ----------
    nodes, packets, instances : (N, 4) float32
    count : int
        Number of instances.
    triangles : (T, 4) int32
        4 per packet: three vertices, material of the mesh.
    normals : (V, 4) float32
        Object space.
    albedos : (2 M, 4), (4 M, 4), (6 M, 4) or (8 M, 4) float32
        Per material of `table_rows`: rgb, opacity; int bits of its texture's first texel, width (0:
        none) and height, then the cutoff. With principled materials also metalness and alpha; the
        texture of their factors. With normal maps also the one of the clear coat; the normal map.
        With emission all these, and emission; the texture of its factors. The fourth number of
        later textures is 1 + the index of their place, or 0.
    uvs, uvs2 : (V, 2) float32 or None
        As in `Mesh`.
    places : (2 P, 4) float32 or None
        Per place: a row of its matrix and whether it is of `uvs2`; the other row and its scale.
    tangents : (V, 4) float32 or None
        As in `Mesh`, object space.
    texels : (T, 4) float16 or None
        Linear rgb and opacity; factors of metalness and of the square root of alpha; or directions
        of normals. The mip levels of each image follow it.
    variants : (M, 4) int32 or None
        Per material, if it has variants: the place of its map among `indices`, width, height, and
        the index of its first variant; else 0.
    indices : (T,) uint8 or None
        Maps of variants.
    """

    nodes: Float4s
    packets: Float4s
    instances: Float4s
    count: Int32
    triangles: Int4s
    normals: Float4s
    albedos: Float4s
    uvs: Float2s = when("TEXTURES")
    uvs2: Float2s = when("TEXTURE_PLACES")
    places: Float4s = when("TEXTURE_PLACES")
    tangents: Float4s = when("NORMAL_MAPS")
    texels: Halves = when("TEXTURES")
    variants: Int4s = when("VARIANTS")
    indices: Bytes = when("VARIANTS")
    work: Counters = when("COUNT_WORK", outer="work_counters")


LAYERS = "!OBJECTS_BVH !DISTANT_ENVIRONMENT"
"""Condition of programs whose rays meet objects as layers."""


@dataclass(kw_only=True)
class ObjectsArgs(Block):
    """Virtual objects for rays (`cl/lib/world/objects/objects.h`).

    Attributes
    ----------
    bounds : (count, 2, 4) float32
        Corners of the objects' boxes, world space.
    count : int
        Number of objects.
    sunlit : (count,) int32 or None
        `Sunlit.marks`.
    bvh : BvhArgs or None
    lamps : LampsArgs or None
    virtual_lights : VirtualLightsArgs or None
    screen, equirect : ObjectLayerArgs or None
        Layers of the view and around the capture centre.
    view : (16,) float32 or None
        `View.kernel_constants()` of `screen`.
    rectangle : int4
        x0, y0, x1, y1 of the screen that objects cover.
    edges : float4
        The same: see `GridArgs`.
    """

    bounds: Float4s
    count: Int32
    sunlit: Ints = when("SUN")
    bvh: BvhArgs | None = when("OBJECTS_BVH")
    lamps: LampsArgs | None = when("OBJECTS_BVH EMISSION")
    virtual_lights: VirtualLightsArgs | None = when("OBJECTS_BVH VIRTUAL_LIGHTS")
    screen: ObjectLayerArgs | None = when(f"{LAYERS} !VIEW_EQUIRECT")
    equirect: ObjectLayerArgs | None = when(LAYERS)
    view: Floats = when(LAYERS)
    rectangle: Int4 = when(LAYERS)
    edges: Float4 = when(LAYERS)

    def __post_init__(self) -> None:
        if self.rectangle is not None:
            self.edges = float4(tuple(float(self.rectangle[axis]) for axis in "xyzw"))


class ObjectBvh:
    """Buffers of `cl/lib/world/objects/objects_bvh.h`.

    Parameters
    ----------
    device : ComputeDevice
    instances : sequence of Instance
        Determine the sizes of the buffers. Nothing is built before `load`.

    Attributes
    ----------
    deforming : bool
        Whether a mesh deforms.
    displacements : (V, 4) float32 or None
        Per vertex, in its mesh's space: to its position before the last `load`. None: no mesh
        deforms, or `follow_vertices` was not called.

    Raises
    ------
    SceneError
        Too many objects or triangles.
    """

    def __init__(self, device: ComputeDevice, instances: Sequence[Instance]) -> None:
        self._device = device
        self._builder = SceneBuilder()
        materials = [m for instance in instances for m in instance.mesh.materials]
        self.deforming = any(instance.mesh.deforms for instance in instances)
        sizes = scene_sizes(shapes_of(instances))
        rows = {name: max(count, 1) for name, count in vars(sizes).items()}
        self._count = sizes.instances
        self._buffers: dict[str, cla.Array] = {}
        self._make("nodes", (rows["nodes"], NODE_ROWS, 4))
        self._make("packets", (rows["packets"], PACKET_ROWS, 4))
        self._make("instances", (rows["instances"], INSTANCE_ROWS, 4))
        self._make("triangles", (4 * rows["packets"], 4), np.int32)
        self._make("normals", (rows["vertices"], 4))
        table, texels = texture_table(materials)
        self._albedos = device.upload("bvh albedos", table)
        self._texels: cla.Array | None = None
        self._loaded: Sequence[Instance] | None = None
        self._meshes = tuple(instance.mesh for instance in instances)  # kept: `Worlds` keys by id
        needs = MaterialNeeds.of(materials)
        if needs.textures:
            self._make("uvs", (rows["vertices"], 2))
            self._texels = device.upload("bvh texels", texels)
        self._maps: dict[str, cla.Array] = {}
        if needs.variants:
            places, indices = variant_table(materials)
            self._maps["variants"] = device.upload("bvh variants", places)
            self._maps["indices"] = device.upload("bvh variant indices", indices)
        if needs.texture_places:
            self._make("uvs2", (rows["vertices"], 2))
            self._maps["places"] = device.upload("bvh texture places", place_table(materials))
        if needs.normal_maps:
            self._make("tangents", (rows["vertices"], 4))
        self._lamps = Lamps(device, instances) if needs.emission else None

    def _make(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> None:
        self._buffers[name] = self._device.empty(f"bvh {name}", shape, dtype)

    def follow_vertices(self) -> None:
        """Keep `displacements` too, if a mesh deforms."""
        if self.deforming and self.displacements is None:
            self._make("displacements", self._buffers["normals"].shape)
            self._device.fill_zero(self._buffers["displacements"])

    @property
    def displacements(self) -> cla.Array | None:
        """Displacement of each vertex since the last `load`, see the class."""
        return self._buffers.get("displacements")

    def load(self, instances: Sequence[Instance]) -> None:
        """Update the objects' positions.

        Does nothing if they are unchanged. With deforming meshes, call it once per frame while
        vertices move, and once more when they stop.
        """
        if self._holds(instances):
            return
        with self._device.profile.host("build bvh"):
            scene = self._builder.build(instances)
        for name in self._buffers:
            values = getattr(scene, name)
            buffer = self._room_for(name, 0 if values is None else len(values))
            if values is None:
                self._device.fill_zero(buffer)
                continue
            # Trees may exceed the bound on the number of nodes.
            rows = np.zeros(buffer.shape, buffer.dtype)
            rows[: len(values)] = values
            self._device.write(buffer, rows)
        if self._lamps is not None:
            self._lamps.load(scene, instances)
        self._loaded = instances

    def _holds(self, instances: Sequence[Instance]) -> bool:
        loaded = self._loaded
        if loaded is None or self.deforming:
            return False
        return instances is loaded or same_places(loaded, instances)

    def _room_for(self, name: str, rows: int) -> cla.Array:
        """Return the buffer, enlarged if necessary.

        Objects that shared a tree may need their own later: a strongly flattened one has no place
        in object space.
        """
        buffer = self._buffers[name]
        if rows > buffer.shape[0]:
            self._make(name, (rows, *buffer.shape[1:]), buffer.dtype)
        return self._buffers[name]

    def arguments(self, boxes: cla.Array) -> ObjectsArgs:
        """Return the objects for rays; `boxes` is `object_bounds()` on the device."""
        bvh = BvhArgs(
            nodes=self._buffers["nodes"],
            packets=self._buffers["packets"],
            instances=self._buffers["instances"],
            count=self._count,
            triangles=self._buffers["triangles"],
            normals=self._buffers["normals"],
            albedos=self._albedos,
            uvs=self._buffers.get("uvs"),
            uvs2=self._buffers.get("uvs2"),
            tangents=self._buffers.get("tangents"),
            texels=self._texels,
            **self._maps,
        )
        lamps = None if self._lamps is None else self._lamps.arguments()
        return ObjectsArgs(bounds=boxes, count=boxes.shape[0], bvh=bvh, lamps=lamps)
