"""Errors for compressed glTF files, with the command that decompresses them.

Khronos glTF extension registry: KHR_draco_mesh_compression, EXT_meshopt_compression,
KHR_meshopt_compression, KHR_texture_basisu. The commands belong to glTF Transform 4
(https://gltf-transform.dev/cli), which decodes Draco and meshopt whenever it reads a file.
"""

from __future__ import annotations

import shlex
from pathlib import Path

from iprt.errors import FormatError
from iprt.geometry.gltf_document import Gltf

_DRACO = "KHR_draco_mesh_compression"
_BASISU = "KHR_texture_basisu"
_MESHES = {
    _DRACO: "Draco",
    "EXT_meshopt_compression": "meshopt",
    "KHR_meshopt_compression": "meshopt",
}


def require_uncompressed(path: Path, gltf: Gltf) -> None:
    """Check that meshes and colour textures can be read without their compressed forms.

    The uncompressed form is read where a file holds both.

    Raises
    ------
    FormatError
        They cannot; the message gives the command that converts the file.
    """
    found = [f"{name} ({key})" for key, name in _MESHES.items() if key in gltf.extensions_required]
    if not found and _has_draco_alone(gltf):
        found = [f"Draco ({_DRACO})"]
    numbers = {reference.index for reference in gltf.color_textures()}
    textures = [entry for number, entry in enumerate(gltf.textures) if number in numbers]
    basis = any(entry.image is None and entry.extensions.basisu is not None for entry in textures)
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
        if primitive.extensions.draco is not None
    ]
    accessors = [gltf.accessors[i] for i in indices if i is not None and i < len(gltf.accessors)]
    return any(accessor.buffer_view is None for accessor in accessors)
