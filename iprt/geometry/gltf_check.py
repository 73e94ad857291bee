"""Checks of a glTF document before its data is read, and errors for compressed files.

Specification: Khronos glTF 2.0, sections 3.5 (scenes), 3.6 (binary data), 3.7 (meshes), 3.9
(materials). Parts that are not read are not checked. Compression: Khronos glTF extension registry
(KHR_draco_mesh_compression, EXT_meshopt_compression, KHR_meshopt_compression, KHR_texture_basisu).
The commands that decompress belong to glTF Transform 4 (https://gltf-transform.dev/cli), which
decodes Draco and meshopt whenever it reads a file.
"""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sized
from pathlib import Path

import numpy as np

from iprt.errors import FormatError
from iprt.files.safe_reading import MAX_BYTES, MAX_TRIANGLES, MAX_VERTICES
from iprt.geometry.gltf_document import (
    MAX_NODES,
    TRIANGLE_STRIP,
    TRIANGLES,
    Accessor,
    Gltf,
    GltfMesh,
    Primitive,
)
from iprt.geometry.gltf_surfaces import UV_SETS

MAX_DEPTH = 256
"""Limit for the nesting of nodes; each is transformed by all its ancestors."""
READ_ATTRIBUTES = {
    "POSITION": ("VEC3",),
    "NORMAL": ("VEC3",),
    "TANGENT": ("VEC4",),
    **{f"TEXCOORD_{number}": ("VEC2",) for number in range(UV_SETS)},
    "COLOR_0": ("VEC3", "VEC4"),
}
"""Vertex attributes that are read besides joints and weights, with their types."""
_INDEX_TYPES = (5121, 5123, 5125)
_DRACO = "KHR_draco_mesh_compression"
_BASISU = "KHR_texture_basisu"
_MESHES = {
    _DRACO: "Draco",
    "EXT_meshopt_compression": "meshopt",
    "KHR_meshopt_compression": "meshopt",
}


def check_gltf(gltf: Gltf) -> None:
    """Raise a one-line ValueError where parts of a document are inconsistent."""
    _check_data(gltf)
    for number, mesh in enumerate(gltf.meshes):
        for primitive in mesh.primitives:
            _check_primitive(gltf, primitive, f"meshes[{number}]")
    for number, material in enumerate(gltf.materials):
        for texture in material.textures():
            _require("texture", texture.index, gltf.textures, f"materials[{number}]")
    for number, entry in enumerate(gltf.textures):
        _require("image", entry.image, gltf.images, f"textures[{number}]")
        _require("sampler", entry.sampler, gltf.samplers, f"textures[{number}]")
    _check_nodes(gltf)


def accessor_of(gltf: Gltf, index: int, types: Collection[str], where: str) -> Accessor:
    """Return a readable accessor of one of these types, or raise a one-line ValueError."""
    _require("accessor", index, gltf.accessors, where)
    accessor = gltf.accessors[index]
    if accessor.buffer_view is None and accessor.sparse is None:
        raise ValueError(f"{where}: compressed data; export it without")
    if accessor.type not in types:
        raise ValueError(f"{where}: made of {accessor.type}")
    return accessor


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
        for one in (accessor, *(accessor.replaced() or ())):
            total += one.count * one.item_bytes
            _check_extent(gltf, one, f"accessors[{number}]")
    if total > MAX_BYTES:
        raise ValueError(f"claims {total} bytes of data; at most {MAX_BYTES} are read")
    for number, image in enumerate(gltf.images):
        _require("bufferView", image.buffer_view, gltf.buffer_views, f"images[{number}]")


def _check_extent(gltf: Gltf, accessor: Accessor, where: str) -> None:
    """Check that an accessor lies within its buffer view, if it has one."""
    if accessor.buffer_view is None:
        return
    _require("bufferView", accessor.buffer_view, gltf.buffer_views, where)
    view = gltf.buffer_views[accessor.buffer_view]
    stride = view.byte_stride or accessor.item_bytes
    end = accessor.byte_offset + (accessor.count - 1) * stride + accessor.item_bytes
    if accessor.count and end > view.byte_length:
        raise ValueError(f"{where}: ends beyond bufferView {accessor.buffer_view}")


def _check_primitive(gltf: Gltf, primitive: Primitive, where: str) -> None:
    """Check the attributes, indices and material of a primitive."""
    if "POSITION" not in primitive.attributes:
        raise ValueError(f"{where}: a primitive without POSITION")
    expected = None
    for name, types in READ_ATTRIBUTES.items():
        if (index := primitive.attributes.get(name)) is not None:
            count = accessor_of(gltf, index, types, f"{where}.{name}").count
            expected = count if expected is None else expected
            if count != expected:
                raise ValueError(f"{where}.{name}: {count} for {expected} vertices")
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
    level = gltf.roots()
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
    primitives, vertices, triangles = shown
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
        triangles += {TRIANGLES: corners // 3, TRIANGLE_STRIP: corners}.get(primitive.mode, 0)
    return len(mesh.primitives), vertices, triangles


def require_uncompressed(path: Path, gltf: Gltf) -> None:
    """Check that meshes and color textures can be read without their compressed forms.

    The uncompressed form is read where a file holds both.

    Raises
    ------
    FormatError
        They cannot; the message gives the command that converts the file.
    """
    found = [f"{name} ({key})" for key, name in _MESHES.items() if key in gltf.extensions_required]
    if not found and _has_draco_alone(gltf):
        found = [f"Draco ({_DRACO})"]
    numbers = {reference.index for reference in gltf.read_textures()}
    textures = [entry for number, entry in enumerate(gltf.textures) if number in numbers]
    basis = any(entry.image is None and entry.basisu is not None for entry in textures)
    if basis:
        found.append(f"BasisU ({_BASISU})")
    if not found:
        return
    plain = path.with_name(f"{path.stem}-plain{path.suffix}")
    verb = "ktxdecompress" if basis else "copy"
    tools = "npm install -g @gltf-transform/cli" + ("; it needs KTX-Software" if basis else "")
    raise FormatError(
        f"{path}: compressed with {' and '.join(found)}, which is not read; convert it: "
        f"{shlex.join(['gltf-transform', verb, str(path), str(plain)])} ({tools})"
    )


def _has_draco_alone(gltf: Gltf) -> bool:
    """Return True if positions exist only in Draco's form; not all files declare it as required."""
    indices = [
        primitive.attributes.get("POSITION")
        for mesh in gltf.meshes
        for primitive in mesh.primitives
        if primitive.draco is not None
    ]
    accessors = [gltf.accessors[i] for i in indices if i is not None and i < len(gltf.accessors)]
    return any(accessor.buffer_view is None for accessor in accessors)
