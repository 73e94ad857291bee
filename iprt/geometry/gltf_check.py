"""What a glTF document claims to hold, checked before anything is read by it.

Specification: Khronos glTF 2.0, sections 3.5 (scenes), 3.6 (binary data), 3.7 (meshes), 3.9
(materials). Only what is read is checked.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from iprt.files.untrusted import MAX_BYTES, MAX_TRIANGLES, MAX_VERTICES

MAX_PARTS = 2**17
"""A document has no more accessors, views or buffers."""
MAX_NODES = 2**14
"""A document has no more nodes or primitives; trimesh takes a millisecond for each."""
MAX_DEPTH = 256
"""Nodes are nested no deeper; each is moved by all above it."""

_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES, _STRIP = 4, 5
_READ_ATTRIBUTES = {"POSITION": "VEC3", "NORMAL": "VEC3", "TEXCOORD_0": "VEC2"}
_INDEX_TYPES = (5121, 5123, 5125)

Index = Annotated[int, Field(ge=0)]
Bytes = Annotated[int, Field(ge=0, le=MAX_BYTES)]
Number = Annotated[float, Field(allow_inf_nan=False)]

Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Quadruple = Annotated[list[Number], Field(min_length=4, max_length=4)]
Matrix = Annotated[list[Number], Field(min_length=16, max_length=16)]


class Part(BaseModel):
    """A part of a document, which may have keys that are not read."""

    model_config = ConfigDict(extra="ignore", strict=True, alias_generator=to_camel)


class Buffer(Part):
    uri: str | None = None
    byte_length: Bytes


class BufferView(Part):
    buffer: Index
    byte_offset: Bytes = 0
    byte_length: Bytes
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class Accessor(Part):
    buffer_view: Index | None = None
    byte_offset: Bytes = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Annotated[int, Field(ge=0, le=MAX_VERTICES)]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Any = None
    normalized: bool = False

    @property
    def item_bytes(self) -> int:
        return _COMPONENT_BYTES[self.component_type] * _COMPONENTS[self.type]


class Image(Part):
    uri: str | None = None
    buffer_view: Index | None = None


class Sampler(Part):
    wrap_s: int = 10497
    wrap_t: int = 10497


class Texture(Part):
    source: Index | None = None
    sampler: Index | None = None


class TextureReference(Part):
    index: Index
    tex_coord: Index = 0


class PbrMetallicRoughness(Part):
    base_color_factor: Quadruple | None = None
    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    base_color_texture: TextureReference | None = None


class GltfMaterial(Part):
    name: str | None = None
    alpha_mode: str = "OPAQUE"
    emissive_factor: Triple | None = None
    pbr_metallic_roughness: PbrMetallicRoughness | None = None


class Primitive(Part):
    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = _TRIANGLES
    targets: list[Any] = Field(default=[])


class GltfMesh(Part):
    name: str | None = None
    primitives: Annotated[list[Primitive], Field(min_length=1)]


class Node(Part):
    name: str | None = None
    children: list[Index] = Field(default=[])
    mesh: Index | None = None
    skin: Index | None = None
    matrix: Matrix | None = None
    translation: Triple | None = None
    rotation: Quadruple | None = None
    scale: Triple | None = None


class GltfScene(Part):
    nodes: list[Index] = Field(default=[])


class Gltf(Part):
    """The parts of a document that are read."""

    scene: Index = 0
    scenes: list[GltfScene] = Field(default=[])
    nodes: Annotated[list[Node], Field(max_length=MAX_NODES)] = Field(default=[])
    meshes: Annotated[list[GltfMesh], Field(max_length=MAX_NODES)] = Field(default=[])
    materials: Annotated[list[GltfMaterial], Field(max_length=MAX_NODES)] = Field(default=[])
    textures: list[Texture] = Field(default=[])
    samplers: list[Sampler] = Field(default=[])
    images: Annotated[list[Image], Field(max_length=MAX_PARTS)] = Field(default=[])
    accessors: Annotated[list[Accessor], Field(max_length=MAX_PARTS)] = Field(default=[])
    buffer_views: Annotated[list[BufferView], Field(max_length=MAX_PARTS)] = Field(default=[])
    buffers: Annotated[list[Buffer], Field(max_length=MAX_PARTS)] = Field(default=[])
    animations: list[Any] = Field(default=[])
    skins: list[Any] = Field(default=[])
    cameras: list[Any] = Field(default=[])
    extensions_used: list[str] = Field(default=[])

    def uris(self) -> list[str]:
        """Where the buffers and images are that do not lie in the binary chunk."""
        named = [*(buffer.uri for buffer in self.buffers), *(image.uri for image in self.images)]
        return [uri for uri in named if uri is not None]

    def color_images(self) -> list[int]:
        """Images that materials take their base colour from."""
        found = []
        for material in self.materials:
            pbr = material.pbr_metallic_roughness
            if pbr is not None and pbr.base_color_texture is not None:
                source = self.textures[pbr.base_color_texture.index].source
                found += [] if source is None else [source]
        return list(dict.fromkeys(found))


def parsed_gltf(document: Any) -> Gltf:
    """The document, checked.

    Raises
    ------
    ValueError
        The first fault, in one line.
    """
    try:
        gltf = Gltf.model_validate(document)
    except ValidationError as error:
        raise ValueError(first_fault(error)) from None
    for problem in _problems(gltf):
        raise ValueError(problem)
    return gltf


def first_fault(error: ValidationError, where: str = "") -> str:
    """One line for the first thing wrong with a part of a document, by its key below `where`."""
    fault = error.errors(include_url=False, include_input=False)[0]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"])
    return f"{(where + key).lstrip('.') or 'document'}: {fault['msg']}"


def _problems(gltf: Gltf) -> Iterator[str]:
    yield from _data_problems(gltf)
    for number, mesh in enumerate(gltf.meshes):
        for primitive in mesh.primitives:
            yield from _primitive_problems(gltf, primitive, f"meshes[{number}]")
    for number, material in enumerate(gltf.materials):
        pbr = material.pbr_metallic_roughness
        if pbr is not None and pbr.base_color_texture is not None:
            index = pbr.base_color_texture.index
            if index >= len(gltf.textures):
                yield f"materials[{number}]: there is no texture {index}"
    for number, texture in enumerate(gltf.textures):
        if texture.source is not None and texture.source >= len(gltf.images):
            yield f"textures[{number}]: there is no image {texture.source}"
        if texture.sampler is not None and texture.sampler >= len(gltf.samplers):
            yield f"textures[{number}]: there is no sampler {texture.sampler}"
    yield from _node_problems(gltf)


def _data_problems(gltf: Gltf) -> Iterator[str]:
    """Buffers, views and accessors that do not lie in each other, or that add up to too much."""
    total = sum(buffer.byte_length for buffer in gltf.buffers)
    for number, view in enumerate(gltf.buffer_views):
        if view.buffer >= len(gltf.buffers):
            yield f"bufferViews[{number}]: there is no buffer {view.buffer}"
        elif view.byte_offset + view.byte_length > gltf.buffers[view.buffer].byte_length:
            yield f"bufferViews[{number}]: ends beyond buffer {view.buffer}"
        total += view.byte_length
    for number, accessor in enumerate(gltf.accessors):
        total += accessor.count * accessor.item_bytes
        if accessor.buffer_view is None:
            continue
        if accessor.buffer_view >= len(gltf.buffer_views):
            yield f"accessors[{number}]: there is no bufferView {accessor.buffer_view}"
            continue
        view = gltf.buffer_views[accessor.buffer_view]
        stride = view.byte_stride or accessor.item_bytes
        end = accessor.byte_offset + (accessor.count - 1) * stride + accessor.item_bytes
        if accessor.count and end > view.byte_length:
            yield f"accessors[{number}]: ends beyond bufferView {accessor.buffer_view}"
    if total > MAX_BYTES:
        yield f"claims {total} bytes of data; at most {MAX_BYTES} are read"
    for number, image in enumerate(gltf.images):
        if image.buffer_view is not None and image.buffer_view >= len(gltf.buffer_views):
            yield f"images[{number}]: there is no bufferView {image.buffer_view}"


def _primitive_problems(gltf: Gltf, primitive: Primitive, where: str) -> Iterator[str]:
    read = {name: primitive.attributes.get(name) for name in _READ_ATTRIBUTES}
    if primitive.indices is not None:
        read["indices"] = primitive.indices
    if read["POSITION"] is None:
        yield f"{where}: a primitive without POSITION"
    for name, index in read.items():
        if index is None:
            continue
        if index >= len(gltf.accessors):
            yield f"{where}.{name}: there is no accessor {index}"
            continue
        accessor = gltf.accessors[index]
        if accessor.buffer_view is None or accessor.sparse is not None:
            yield f"{where}.{name}: compressed or sparse data; export it without"
        if accessor.type != _READ_ATTRIBUTES.get(name, "SCALAR"):
            yield f"{where}.{name}: made of {accessor.type}"
        # trimesh takes 255 for 255, not for 1; normals get unit length and do not mind.
        if name in ("POSITION", "TEXCOORD_0") and accessor.normalized:
            yield f"{where}.{name}: fractions stored as integers; export floats"
        if name == "indices" and accessor.component_type not in _INDEX_TYPES:
            yield f"{where}.{name}: not whole numbers"
    if primitive.material is not None and primitive.material >= len(gltf.materials):
        yield f"{where}: there is no material {primitive.material}"


def _node_problems(gltf: Gltf) -> Iterator[str]:
    """Nodes that form no trees, and meshes that they repeat too often."""
    if gltf.scenes and gltf.scene >= len(gltf.scenes):
        yield f"there is no scene {gltf.scene}"
        return
    parents = [0] * len(gltf.nodes)
    for number, node in enumerate(gltf.nodes):
        if node.mesh is not None and node.mesh >= len(gltf.meshes):
            yield f"nodes[{number}]: there is no mesh {node.mesh}"
        for child in node.children:
            if child >= len(gltf.nodes):
                yield f"nodes[{number}]: there is no node {child}"
            elif parents[child]:
                yield f"nodes[{number}]: node {child} has two parents"
            else:
                parents[child] = 1
    level = list(dict.fromkeys(gltf.scenes[gltf.scene].nodes)) if gltf.scenes else []
    if any(root >= len(gltf.nodes) or parents[root] for root in level):
        yield "scenes: a node that does not exist, or is not the root of a tree"
        return
    sizes = [_Size.of(gltf, mesh) for mesh in gltf.meshes]
    depth, size = 0, _Size()
    while level:
        depth += 1
        nodes = [gltf.nodes[index] for index in level]
        size = sum((sizes[node.mesh] for node in nodes if node.mesh is not None), size)
        if depth > MAX_DEPTH:
            yield f"more than {MAX_DEPTH} levels of nodes"
            return
        level = [child for node in nodes for child in node.children]
    yield from _too_many(size)
    # All meshes are read, whether nodes show them or not.
    yield from _too_many(sum(sizes, _Size()))


@dataclass(frozen=True)
class _Size:
    """How much there is to read."""

    primitives: int = 0
    vertices: int = 0
    triangles: int = 0

    def __add__(self, other: _Size) -> _Size:
        return _Size(
            self.primitives + other.primitives,
            self.vertices + other.vertices,
            self.triangles + other.triangles,
        )

    @classmethod
    def of(cls, gltf: Gltf, mesh: GltfMesh) -> _Size:
        vertices = triangles = 0
        for primitive in mesh.primitives:
            count = gltf.accessors[primitive.attributes["POSITION"]].count
            vertices += count
            index = primitive.indices
            corners = count if index is None else gltf.accessors[index].count
            triangles += {_TRIANGLES: corners // 3, _STRIP: corners}.get(primitive.mode, 0)
        return cls(len(mesh.primitives), vertices, triangles)


def _too_many(size: _Size) -> Iterator[str]:
    if size.primitives > MAX_NODES:
        yield f"{size.primitives} primitives; at most {MAX_NODES} are read"
    if size.vertices > MAX_VERTICES or size.triangles > MAX_TRIANGLES:
        yield (
            f"{size.triangles} triangles and {size.vertices} vertices; "
            f"at most {MAX_TRIANGLES} and {MAX_VERTICES} are read"
        )
