"""Checks of a glTF document before its data is read.

Specification: Khronos glTF 2.0, sections 3.5 (scenes), 3.6 (binary data), 3.7 (meshes), 3.9
(materials). Parts that are not read are not checked.
"""

from __future__ import annotations

from collections.abc import Collection, Sized
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from iprt.files.untrusted import MAX_BYTES, MAX_TRIANGLES, MAX_VERTICES

MAX_PARTS = 2**17
"""Limit for accessors, buffer views and buffers of a document, each."""
MAX_NODES = 2**14
"""Limit for nodes and primitives of a document, each; trimesh takes a millisecond for each."""
MAX_DEPTH = 256
"""Limit for the nesting of nodes; each is transformed by all its ancestors."""

_FLOAT32 = 5126
_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES, _STRIP = 4, 5
READ_ATTRIBUTES = {"POSITION": "VEC3", "NORMAL": "VEC3", "TEXCOORD_0": "VEC2"}
"""Vertex attributes that trimesh reads itself, with their types."""
_INDEX_TYPES = (5121, 5123, 5125)

Index = Annotated[int, Field(ge=0)]
Bytes = Annotated[int, Field(ge=0, le=MAX_BYTES)]
Number = Annotated[float, Field(allow_inf_nan=False)]

Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Quadruple = Annotated[list[Number], Field(min_length=4, max_length=4)]
Matrix = Annotated[list[Number], Field(min_length=16, max_length=16)]


class Part(BaseModel):
    """A part of a glTF document; unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore", strict=True, alias_generator=to_camel)


Model = TypeVar("Model", bound=Part)


class Buffer(Part):
    """A buffer: binary data in a file or in the document."""

    uri: str | None = None
    byte_length: Bytes


class BufferView(Part):
    """A buffer view: a range of a buffer."""

    buffer: Index
    byte_offset: Bytes = 0
    byte_length: Bytes
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class Accessor(Part):
    """An accessor: typed elements in a buffer view."""

    buffer_view: Index | None = None
    byte_offset: Bytes = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Annotated[int, Field(ge=0, le=MAX_VERTICES)]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Any = None
    normalized: bool = False

    @property
    def is_integer(self) -> bool:
        """True for integer components."""
        return self.component_type != _FLOAT32

    @property
    def item_bytes(self) -> int:
        """Size of an element in bytes."""
        return _COMPONENT_BYTES[self.component_type] * _COMPONENTS[self.type]


class Image(Part):
    """An image, in a file or in a buffer view."""

    uri: str | None = None
    buffer_view: Index | None = None


class Sampler(Part):
    """A texture sampler; only its wrap modes are read."""

    wrap_s: int = 10497
    wrap_t: int = 10497


class TextureSource(Part):
    """A texture's image in an extension."""

    source: Index | None = None


class TextureExtensions(Part):
    """Extensions of a texture."""

    webp: TextureSource | None = Field(default=None, alias="EXT_texture_webp")
    basisu: TextureSource | None = Field(default=None, alias="KHR_texture_basisu")


class Texture(Part):
    """A texture: an image and a sampler."""

    source: Index | None = None
    sampler: Index | None = None
    extensions: TextureExtensions = Field(default=TextureExtensions())

    @property
    def image(self) -> int | None:
        """Index of the image to read: the WebP image, which Pillow reads, or else the core one."""
        webp = self.extensions.webp
        return self.source if webp is None or webp.source is None else webp.source


class TextureTransform(Part):
    """A transform of texture coordinates (KHR_texture_transform)."""

    offset: list[Number] = Field(default=[0.0, 0.0])
    rotation: Number = 0.0
    scale: list[Number] = Field(default=[1.0, 1.0])
    tex_coord: Index | None = None

    @property
    def changes(self) -> bool:
        """True unless the transform is the identity."""
        return self.offset != [0.0, 0.0] or self.rotation != 0.0 or self.scale != [1.0, 1.0]


class ReferenceExtensions(Part):
    """Extensions of a texture reference."""

    transform: TextureTransform | None = Field(default=None, alias="KHR_texture_transform")


class TextureReference(Part):
    """A material's reference to a texture."""

    index: Index
    tex_coord: Index = 0
    extensions: ReferenceExtensions = Field(default=ReferenceExtensions())

    @property
    def coordinates(self) -> int:
        """Index of the texture coordinate set."""
        transform = self.extensions.transform
        given = None if transform is None else transform.tex_coord
        return self.tex_coord if given is None else given

    @property
    def moved(self) -> bool:
        """True if KHR_texture_transform changes the texture coordinates."""
        return self.extensions.transform is not None and self.extensions.transform.changes


class PbrMetallicRoughness(Part):
    """The metallic-roughness parameters of a material."""

    base_color_factor: Quadruple | None = None
    metallic_factor: Number = 1.0
    roughness_factor: Number = 1.0
    base_color_texture: TextureReference | None = None


class SpecularGlossiness(Part):
    """The specular-glossiness parameters of a material; only the texture is read."""

    diffuse_texture: TextureReference | None = None


class MaterialExtensions(Part):
    """Extensions of a material."""

    glossy: SpecularGlossiness | None = Field(
        default=None, alias="KHR_materials_pbrSpecularGlossiness"
    )


class GltfMaterial(Part):
    """A material."""

    name: str | None = None
    alpha_mode: str = "OPAQUE"
    emissive_factor: Triple | None = None
    pbr_metallic_roughness: PbrMetallicRoughness | None = None
    extensions: MaterialExtensions = Field(default=MaterialExtensions())

    def color_textures(self) -> list[TextureReference]:
        """Return the colour textures of this material."""
        pbr, glossy = self.pbr_metallic_roughness, self.extensions.glossy
        given = [
            None if pbr is None else pbr.base_color_texture,
            None if glossy is None else glossy.diffuse_texture,
        ]
        return [texture for texture in given if texture is not None]


class PrimitiveExtensions(Part):
    """Extensions of a primitive."""

    draco: Any = Field(default=None, alias="KHR_draco_mesh_compression")


class Primitive(Part):
    """A primitive: vertices and indices with one material."""

    attributes: dict[str, Index]
    extensions: PrimitiveExtensions = Field(default=PrimitiveExtensions())
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = _TRIANGLES
    targets: list[Any] = Field(default=[])


class GltfMesh(Part):
    """A mesh."""

    name: str | None = None
    primitives: Annotated[list[Primitive], Field(min_length=1)]


class Node(Part):
    """A node: a transform with a mesh, a skin and children."""

    name: str | None = None
    children: list[Index] = Field(default=[])
    mesh: Index | None = None
    skin: Index | None = None
    matrix: Matrix | None = None
    translation: Triple | None = None
    rotation: Quadruple | None = None
    scale: Triple | None = None


class GltfScene(Part):
    """A scene: the roots of its node trees."""

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
    extensions_required: list[str] = Field(default=[])

    def uris(self) -> list[str]:
        """Return the URIs of buffers and images outside the binary chunk."""
        named = [*(buffer.uri for buffer in self.buffers), *(image.uri for image in self.images)]
        return [uri for uri in named if uri is not None]

    def color_images(self) -> list[int]:
        """Return the indices of the images used as base colour."""
        images = [self.textures[texture.index].image for texture in self.color_textures()]
        return list(dict.fromkeys(image for image in images if image is not None))

    def color_textures(self) -> list[TextureReference]:
        """Return the colour textures of all materials."""
        return [texture for material in self.materials for texture in material.color_textures()]


def parsed_gltf(document: Any) -> Gltf:
    """Parse a document whose parts have the right shapes; `check_gltf` checks their references.

    Raises
    ------
    ValueError
        The document is malformed; the message names the first fault in one line.
    """
    return parsed_part(Gltf, document, "")


def check_gltf(gltf: Gltf) -> None:
    """Raise a one-line ValueError where parts of a document are inconsistent."""
    _check_data(gltf)
    for number, mesh in enumerate(gltf.meshes):
        for primitive in mesh.primitives:
            _check_primitive(gltf, primitive, f"meshes[{number}]")
    for number, material in enumerate(gltf.materials):
        for texture in material.color_textures():
            _require("texture", texture.index, gltf.textures, f"materials[{number}]")
    for number, entry in enumerate(gltf.textures):
        _require("image", entry.image, gltf.images, f"textures[{number}]")
        _require("sampler", entry.sampler, gltf.samplers, f"textures[{number}]")
    _check_nodes(gltf)


def accessor_of(gltf: Gltf, index: int, types: Collection[str], where: str) -> Accessor:
    """Return a readable accessor of one of these types, or raise a one-line ValueError."""
    _require("accessor", index, gltf.accessors, where)
    accessor = gltf.accessors[index]
    if accessor.buffer_view is None or accessor.sparse is not None:
        raise ValueError(f"{where}: compressed or sparse data; export it without")
    if accessor.type not in types:
        raise ValueError(f"{where}: made of {accessor.type}")
    return accessor


def parsed_part(model: type[Model], value: Any, where: str) -> Model:
    """Parse a part of a document, or raise a ValueError that names the first fault in one line."""
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise ValueError(_first_fault(error, where)) from None


def _first_fault(error: ValidationError, where: str = "") -> str:
    """Return the first validation error in one line, with its key below `where`."""
    fault = error.errors(include_url=False, include_input=False)[0]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"])
    return f"{(where + key).lstrip('.') or 'document'}: {fault['msg']}"


def _require(kind: str, index: int | None, known: Sized, where: str) -> None:
    """Raise ValueError where a part refers to a missing part."""
    if index is not None and index >= len(known):
        raise ValueError(f"{where}: there is no {kind} {index}")


def _check_data(gltf: Gltf) -> None:
    """Check that buffers, views and accessors lie within each other and within the size limit."""
    total = sum(buffer.byte_length for buffer in gltf.buffers)
    for number, view in enumerate(gltf.buffer_views):
        _require("buffer", view.buffer, gltf.buffers, f"bufferViews[{number}]")
        if view.byte_offset + view.byte_length > gltf.buffers[view.buffer].byte_length:
            raise ValueError(f"bufferViews[{number}]: ends beyond buffer {view.buffer}")
        total += view.byte_length
    for number, accessor in enumerate(gltf.accessors):
        total += accessor.count * accessor.item_bytes
        if accessor.buffer_view is None:
            continue
        _require("bufferView", accessor.buffer_view, gltf.buffer_views, f"accessors[{number}]")
        view = gltf.buffer_views[accessor.buffer_view]
        stride = view.byte_stride or accessor.item_bytes
        end = accessor.byte_offset + (accessor.count - 1) * stride + accessor.item_bytes
        if accessor.count and end > view.byte_length:
            raise ValueError(f"accessors[{number}]: ends beyond bufferView {accessor.buffer_view}")
    if total > MAX_BYTES:
        raise ValueError(f"claims {total} bytes of data; at most {MAX_BYTES} are read")
    for number, image in enumerate(gltf.images):
        _require("bufferView", image.buffer_view, gltf.buffer_views, f"images[{number}]")


def _check_primitive(gltf: Gltf, primitive: Primitive, where: str) -> None:
    """Check the attributes, indices and material of a primitive."""
    if "POSITION" not in primitive.attributes:
        raise ValueError(f"{where}: a primitive without POSITION")
    for name, kind in READ_ATTRIBUTES.items():
        if (index := primitive.attributes.get(name)) is not None:
            accessor_of(gltf, index, (kind,), f"{where}.{name}")
    if primitive.indices is not None:
        accessor = accessor_of(gltf, primitive.indices, ("SCALAR",), f"{where}.indices")
        if accessor.component_type not in _INDEX_TYPES:
            raise ValueError(f"{where}.indices: not whole numbers")
    _require("material", primitive.material, gltf.materials, where)


def _check_nodes(gltf: Gltf) -> None:
    """Check that nodes form trees and that the meshes they repeat stay within the limits."""
    if gltf.scenes and gltf.scene >= len(gltf.scenes):
        raise ValueError(f"there is no scene {gltf.scene}")
    children: set[int] = set()
    for number, node in enumerate(gltf.nodes):
        _require("mesh", node.mesh, gltf.meshes, f"nodes[{number}]")
        for child in node.children:
            _require("node", child, gltf.nodes, f"nodes[{number}]")
            if child in children:
                raise ValueError(f"nodes[{number}]: node {child} has two parents")
            children.add(child)
    level = list(dict.fromkeys(gltf.scenes[gltf.scene].nodes)) if gltf.scenes else []
    if any(root >= len(gltf.nodes) or root in children for root in level):
        raise ValueError("scenes: a node that does not exist, or is not the root of a tree")
    sizes = np.array([_size(gltf, mesh) for mesh in gltf.meshes], np.int64).reshape(-1, 3)
    depth, shown = 0, np.zeros(3, np.int64)
    while level:
        depth += 1
        nodes = [gltf.nodes[index] for index in level]
        shown += sizes[[node.mesh for node in nodes if node.mesh is not None]].sum(axis=0)
        if depth > MAX_DEPTH:
            raise ValueError(f"more than {MAX_DEPTH} levels of nodes")
        level = [child for node in nodes for child in node.children]
    # trimesh reads all meshes, with or without a node.
    for primitives, vertices, triangles in (shown, sizes.sum(axis=0)):
        if primitives > MAX_NODES:
            raise ValueError(f"{primitives} primitives; at most {MAX_NODES} are read")
        if vertices > MAX_VERTICES or triangles > MAX_TRIANGLES:
            raise ValueError(
                f"{triangles} triangles and {vertices} vertices; "
                f"at most {MAX_TRIANGLES} and {MAX_VERTICES} are read"
            )


def _size(gltf: Gltf, mesh: GltfMesh) -> tuple[int, int, int]:
    """Return the numbers of primitives, vertices and triangles of a mesh."""
    vertices = triangles = 0
    for primitive in mesh.primitives:
        count = gltf.accessors[primitive.attributes["POSITION"]].count
        vertices += count
        index = primitive.indices
        corners = count if index is None else gltf.accessors[index].count
        triangles += {_TRIANGLES: corners // 3, _STRIP: corners}.get(primitive.mode, 0)
    return len(mesh.primitives), vertices, triangles
