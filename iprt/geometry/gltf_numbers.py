"""A glTF document rewritten so that the parts that trimesh makes of it carry numbers."""

from __future__ import annotations

import json
from typing import Any

INFLUENCES = (0, 1)
"""Sets of four joints per vertex that are read."""
JOINT_KEYS = tuple(f"_JOINTS_{number}" for number in INFLUENCES)
WEIGHT_KEYS = tuple(f"_WEIGHTS_{number}" for number in INFLUENCES)
COLOR_KEY = "_COLOR_0"
CHUNK = "\0"
"""An address that no file can have."""


def numbered(document: dict[str, Any]) -> bytes:
    """The text of a document, of which `gltf_check` knows that it is one.

    Nodes get their numbers for names; trimesh adds to these behind an underscore. It hands on
    attributes of vertices whose names begin with one as they are, which joints, weights and colours
    get. The binary data of a .glb file gets the address `CHUNK`.
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
    return json.dumps(document | {"nodes": nodes, "meshes": meshes, "buffers": buffers}).encode()


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
    return primitive | {"attributes": kept | more}
