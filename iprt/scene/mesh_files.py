"""What a mesh file refers to and holds, read from the file itself.

trimesh passes over missing textures and over what it does not know, in silence; this finds both.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from iprt.errors import FormatError

MESH_SUFFIXES = (".ply", ".obj", ".gltf", ".glb")
_TRIANGLE_MODES = (4, 5)


def check_mesh_file(path: Path) -> None:
    """Raise FormatError unless the file exists and its suffix is one that is read."""
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise FormatError(f"{path}: not a PLY, OBJ, glTF or GLB file (by its suffix)")
    if not path.is_file():
        raise FormatError(f"{path}: no such mesh file")


def referenced_files(path: Path) -> list[Path]:
    """Files that a mesh needs besides itself: buffers, material libraries, colour textures.

    Returns
    -------
    list of Path
        Relative to the mesh's folder.

    Raises
    ------
    FormatError
        A file is missing, or lies outside the mesh's folder.
    """
    suffix = path.suffix.lower()
    found: list[Path] = []
    for name in _references(path, suffix):
        relative = PurePosixPath(name.replace("\\", "/"))
        if relative.is_absolute() or ".." in relative.parts:
            raise FormatError(f"{path}: refers to {name}, outside its folder; copy it beside it")
        if not (path.parent / relative).is_file():
            raise FormatError(f"{path}: refers to {name}, which is missing beside it")
        found.append(Path(relative))
    return list(dict.fromkeys(found))


def gltf_document(path: Path) -> dict[str, Any]:
    """The JSON of a .gltf or .glb file.

    Raises
    ------
    FormatError
    """
    try:
        data = path.read_bytes()
        if path.suffix.lower() == ".glb":
            magic, _, _, length, kind = struct.unpack_from("<4sIII4s", data)
            if magic != b"glTF" or kind != b"JSON":
                raise ValueError("no glTF header")
            data = data[20 : 20 + length]
        document = json.loads(data)
        if not isinstance(document, dict):
            raise ValueError("not a JSON object")
    except (OSError, struct.error, ValueError, RecursionError) as error:
        raise FormatError(f"{path}: cut off or damaged glTF file ({error})") from error
    return document


def unread_parts(path: Path) -> list[str]:
    """What the file holds and is not read, one phrase each, in a fixed order."""
    suffix = path.suffix.lower()
    if suffix in (".gltf", ".glb"):
        return list(_unread_gltf(gltf_document(path)))
    if suffix == ".obj":
        kinds = {line.split()[0] for line in _lines(path) if line.split()}
        return [word for word, key in (("lines", "l"), ("points", "p")) if key in kinds]
    return []


def _references(path: Path, suffix: str) -> Iterator[str]:
    if suffix in (".gltf", ".glb"):
        document = gltf_document(path)
        for entry in [*_list(document, "buffers"), *_list(document, "images")]:
            uri = entry.get("uri")
            if isinstance(uri, str) and not uri.startswith("data:"):
                yield unquote(uri)
    elif suffix == ".obj":
        for line in _lines(path):
            if line.startswith("mtllib "):
                library = line.removeprefix("mtllib ").strip()
                yield library
                if (path.parent / library).is_file():
                    yield from _material_maps(path.parent / library)
    else:
        yield from _ply_textures(path)


def _material_maps(path: Path) -> Iterator[str]:
    """Colour textures of an MTL file; an option such as `-s 1 1 1` ends before the file's name."""
    for line in _lines(path):
        words = line.split()
        if words and words[0].lower() == "map_kd":
            yield words[-1] if any(word.startswith("-") for word in words) else line[7:].strip()


def _ply_textures(path: Path) -> Iterator[str]:
    with path.open("rb") as file:
        for _ in range(200):
            line = file.readline(1000).decode("utf-8", "replace").strip()
            if line.lower().startswith("comment texturefile"):
                yield line[len("comment texturefile") :].strip()
            if not line or line == "end_header":
                return


def _unread_gltf(document: dict[str, Any]) -> Iterator[str]:
    for key in ("animations", "skins", "cameras"):
        if count := len(_list(document, key)):
            yield f"{key} ({count})"
    primitives = [
        primitive for mesh in _list(document, "meshes") for primitive in _list(mesh, "primitives")
    ]
    if any(primitive.get("mode", 4) not in _TRIANGLE_MODES for primitive in primitives):
        yield "points, lines or triangle fans"
    if any("targets" in primitive for primitive in primitives):
        yield "morph targets"
    if any("COLOR_0" in primitive.get("attributes", {}) for primitive in primitives):
        yield "vertex colours"
    extensions = document.get("extensionsUsed")
    for name in extensions if isinstance(extensions, list) else []:
        yield f"extension {name}"


def _list(table: dict[str, Any], key: str) -> list[dict[str, Any]]:
    value = table.get(key)
    return [entry for entry in value if isinstance(entry, dict)] if isinstance(value, list) else []


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            yield line.strip()
