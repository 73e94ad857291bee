"""A glTF document rewritten so that what trimesh makes of it can be told apart by number."""

from __future__ import annotations

import json
import struct
from typing import Any

INFLUENCES = (0, 1)
"""Sets of four joints per vertex that are read."""
JOINT_KEYS = tuple(f"_JOINTS_{number}" for number in INFLUENCES)
WEIGHT_KEYS = tuple(f"_WEIGHTS_{number}" for number in INFLUENCES)


def numbered(document: dict[str, Any], chunk: bytes | None) -> bytes:
    """The file of a document, of which `gltf_check` knows that it is one.

    Nodes get their numbers for names; trimesh adds to these behind an underscore. It hands on
    attributes of vertices whose names begin with one, which joints and weights get.

    Parameters
    ----------
    document : dict
    chunk : bytes or None
        Binary data: of a .glb file; None: a .gltf file.
    """
    nodes = [
        {key: value for key, value in node.items() if key != "camera"} | {"name": str(number)}
        for number, node in enumerate(document.get("nodes", []))
    ]
    meshes = [
        mesh | {"primitives": [_with_joints(primitive) for primitive in mesh["primitives"]]}
        for mesh in document.get("meshes", [])
    ]
    text = json.dumps(document | {"nodes": nodes, "meshes": meshes}).encode()
    if chunk is None:
        return text
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    if chunk:
        body += struct.pack("<I4s", len(chunk), b"BIN\0") + chunk
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def part_node(name: str) -> int:
    """The number of the node that trimesh gave a name, possibly longer."""
    return int(name.partition("_")[0])


def _with_joints(primitive: dict[str, Any]) -> dict[str, Any]:
    given = primitive["attributes"]
    more = {
        f"_{kind}_{number}": given[f"{kind}_{number}"]
        for number in INFLUENCES
        for kind in ("JOINTS", "WEIGHTS")
        if f"{kind}_{number}" in given
    }
    return primitive | {"attributes": given | more}
