"""Rewriting of a glTF document so that trimesh's geometries can be traced back to it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

INFLUENCES = (0, 1)
"""Sets of four joints per vertex that are read (JOINTS_0, JOINTS_1)."""
JOINT_KEYS = tuple(f"_JOINTS_{number}" for number in INFLUENCES)
WEIGHT_KEYS = tuple(f"_WEIGHTS_{number}" for number in INFLUENCES)
COLOR_KEY = "_COLOR_0"
CHUNK = "\0"
"""URI of a .glb file's binary chunk; no file can have this name."""
FLOATS = "\0floats"
"""URI of the buffer with float32 data that replaces integer accessors."""
_FLOAT32 = 5126


def numbered(document: dict[str, Any], floats: Mapping[int, NDArray[np.float32]]) -> bytes:
    """Return the text of a checked document, rewritten for trimesh.

    Nodes are renamed to their indices; trimesh may append a suffix after an underscore. Joints,
    weights and colors get names that begin with an underscore, because trimesh passes such
    attributes on unchanged. The binary chunk of a .glb file gets the URI `CHUNK`. Compressed forms
    of meshes are removed.

    Parameters
    ----------
    floats : mapping of int to (count, columns) float32
        Replacements by accessor index. They lie at the URI `FLOATS`, one after another.
    """
    nodes = [
        {key: value for key, value in node.items() if key != "camera"} | {"name": str(number)}
        for number, node in enumerate(document.get("nodes", []))
    ]
    meshes = [
        mesh | {"primitives": [_renamed(primitive) for primitive in mesh["primitives"]]}
        for mesh in document.get("meshes", [])
    ]
    buffers = [{"uri": CHUNK} | buffer for buffer in document.get("buffers", [])]
    accessors = list(document.get("accessors", []))
    views = list(document.get("bufferViews", []))
    place = 0
    for number, values in floats.items():
        accessors[number] = {
            "bufferView": len(views),
            "componentType": _FLOAT32,
            "count": len(values),
            "type": accessors[number]["type"],
        }
        views.append({"buffer": len(buffers), "byteOffset": place, "byteLength": values.nbytes})
        place += values.nbytes
    if floats:
        buffers.append({"uri": FLOATS, "byteLength": place})
    changed = {
        "nodes": nodes,
        "meshes": meshes,
        "buffers": buffers,
        "bufferViews": views,
        "accessors": accessors,
    }
    return json.dumps(document | changed).encode()


def part_node(name: str) -> int:
    """Return the node index in a name given by trimesh, which may have a suffix."""
    return int(name.partition("_")[0])


def _renamed(primitive: dict[str, Any]) -> dict[str, Any]:
    given = primitive["attributes"]
    more = {
        f"_{kind}_{number}": given[f"{kind}_{number}"]
        for number in INFLUENCES
        for kind in ("JOINTS", "WEIGHTS")
        if f"{kind}_{number}" in given
    }
    if "COLOR_0" in given:  # trimesh would keep the lower 8 of 16 bits
        more[COLOR_KEY] = given["COLOR_0"]
    kept = {name: index for name, index in given.items() if name != "COLOR_0"}
    plain = {key: value for key, value in primitive.items() if key != "extensions"}
    return plain | {"attributes": kept | more}
