"""Data model of a glTF document, validated by pydantic.

Specification: Khronos glTF 2.0, sections 3.5 (scenes), 3.6 (binary data), 3.7 (meshes). Materials:
`gltf_surfaces`. Parts that are not read are left out.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Field, ValidationError

from iprt.files.safe_reading import MAX_VERTICES
from iprt.geometry.gltf_part import (
    Bytes,
    Index,
    Matrix,
    Part,
    Quadruple,
    Triple,
    extension,
)
from iprt.geometry.gltf_surfaces import GltfMaterial, TextureReference

MAX_PARTS = 2**17
"""Limit for accessors, buffer views and buffers of a document, each."""
MAX_NODES = 2**14
"""Limit for nodes and primitives of a document, each; all of them are visited in Python."""
TRIANGLES, TRIANGLE_STRIP = 4, 5
"""Modes of primitives that are read."""

_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

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


class SparsePart(Part):
    """A place of the indices or of the values of replaced elements."""

    buffer_view: Index
    byte_offset: Bytes = 0
    component_type: Literal[5121, 5123, 5125] = 5125


class Sparse(Part):
    """Replaced elements of an accessor (section 3.6.2.3)."""

    count: Annotated[int, Field(ge=1, le=MAX_VERTICES)]
    indices: SparsePart
    values: SparsePart


class Accessor(Part):
    """An accessor: typed elements in a buffer view, zeros without one."""

    buffer_view: Index | None = None
    byte_offset: Bytes = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Annotated[int, Field(ge=0, le=MAX_VERTICES)]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Sparse | None = None
    normalized: bool = False

    def replaced(self) -> tuple[Accessor, Accessor] | None:
        """Return accessors of the indices and values of replaced elements."""
        if self.sparse is None:
            return None

        def stored(part: SparsePart, **other: Any) -> Accessor:
            where = {"buffer_view": part.buffer_view, "byte_offset": part.byte_offset}
            return self.model_copy(update={**where, "count": count, "sparse": None, **other})

        count, indices = self.sparse.count, self.sparse.indices
        rows = stored(indices, component_type=indices.component_type, type="SCALAR")
        return rows, stored(self.sparse.values)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the components."""
        return np.dtype(_DTYPES[self.component_type])

    @property
    def item_bytes(self) -> int:
        """Size of an element in bytes."""
        return self.dtype.itemsize * _COMPONENTS[self.type]


class Image(Part):
    """An image, in a file or in a buffer view."""

    uri: str | None = None
    buffer_view: Index | None = None


class Sampler(Part):
    """A texture sampler; the filter of small textures is read, mipmaps are always used."""

    mag_filter: int | None = None
    wrap_s: int = 10497
    wrap_t: int = 10497


class Texture(Part):
    """A texture: an image and a sampler."""

    source: Index | None = None
    sampler: Index | None = None
    webp: Index | None = extension("EXT_texture_webp", "source")
    basisu: Index | None = extension("KHR_texture_basisu", "source")

    @property
    def image(self) -> int | None:
        """Index of the image to read: the WebP image, which Pillow reads, or else the core one."""
        return self.source if self.webp is None else self.webp


class Primitive(Part):
    """A primitive: vertices and indices with one material."""

    attributes: dict[str, Index]
    draco: Any = extension("KHR_draco_mesh_compression")
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = TRIANGLES
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

    def roots(self) -> list[int]:
        """Return the root nodes of the scene; of a document without scenes, all roots."""
        if self.scenes:
            return list(dict.fromkeys(self.scenes[self.scene].nodes))
        children = {child for node in self.nodes for child in node.children}
        return [index for index in range(len(self.nodes)) if index not in children]

    def read_images(self) -> list[int]:
        """Return the indices of the images of the textures that are read."""
        images = [self.textures[texture.index].image for texture in self.read_textures()]
        return list(dict.fromkeys(image for image in images if image is not None))

    def read_textures(self) -> list[TextureReference]:
        """Return the textures of all materials that are read."""
        return [texture for material in self.materials for texture in material.textures()]


def parsed_gltf(document: Any) -> Gltf:
    """Parse a document whose parts have the right shapes; `check_gltf` checks their references.

    Raises
    ------
    ValueError
        The document is malformed; the message names the first fault in one line.
    """
    return parsed_part(Gltf, document, "")


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
