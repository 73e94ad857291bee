"""A glTF document rewritten so that the parts that trimesh makes of it carry numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

INFLUENCES = (0, 1)
"""Sets of four joints per vertex that are read."""
JOINT_KEYS = tuple(f"_JOINTS_{number}" for number in INFLUENCES)
WEIGHT_KEYS = tuple(f"_WEIGHTS_{number}" for number in INFLUENCES)
COLOR_KEY = "_COLOR_0"
CHUNK = "\0"
"""An address that no file can have."""
FLOATS = "\0floats"
"""The same, of a buffer of float32 numbers in place of integers."""
_FLOAT32 = 5126


def numbered(document: dict[str, Any], floats: Mapping[int, NDArray[np.float32]]) -> bytes:
    """Return the text of a document, of which `gltf_check` knows that it is one, for trimesh.

    Nodes get their numbers for names; trimesh adds to these behind an underscore. It hands on
    attributes of vertices whose names begin with one as they are, which joints, weights and colours
    get. The binary data of a .glb file gets the address `CHUNK`. Compressed forms of meshes are
    left out.

    Parameters
    ----------
    floats : mapping of int to (count, columns) float32
        Numbers in place of accessors, by the accessor's number; they are at the address `FLOATS`,
        one behind the other.
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
    """The number of the node that trimesh gave a name, possibly longer."""
    return int(name.partition("_")[0])


def _renamed(primitive: dict[str, Any]) -> dict[str, Any]:
    given = primitive["attributes"]
    more = {
        f"_{kind}_{number}": given[f"{kind}_{number}"]
        for number in INFLUENCES
        for kind in ("JOINTS", "WEIGHTS")
        if f"{kind}_{number}" in given
    }
    if "COLOR_0" in given:  # of which trimesh keeps the lower 8 of 16 bits
        more[COLOR_KEY] = given["COLOR_0"]
    kept = {name: index for name, index in given.items() if name != "COLOR_0"}
    plain = {key: value for key, value in primitive.items() if key != "extensions"}
    return plain | {"attributes": kept | more}
