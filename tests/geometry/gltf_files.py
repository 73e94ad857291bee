"""glTF files with animations, written from arrays."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from iprt.geometry.mesh import Mesh
from tests.scene.nasty_meshes import glb

_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
BAR_HEIGHTS = np.linspace(0.0, 2.0, 9)
TURN = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
"""A quarter turn about z."""
STILL = (0.0, 0.0, 0.0, 1.0)


class GltfFile:
    """A document that grows; `document` may be changed before it is written."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }
        self.data = b""

    def array(self, values: ArrayLike, dtype: str = "f4", **more: Any) -> int:
        """An accessor; rows are its items."""
        rows = np.asarray(values)
        rows = rows.reshape(len(rows), int(np.prod(rows.shape[1:]))).astype(f"<{dtype}")
        self.document["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": rows.nbytes}
        )
        self.document["accessors"].append(
            {
                "bufferView": len(self.document["bufferViews"]) - 1,
                "componentType": _COMPONENTS[dtype],
                "count": len(rows),
                "type": _TYPES[rows.shape[1]],
                **more,
            }
        )
        self.data += rows.tobytes() + bytes(-rows.nbytes % 4)
        return len(self.document["accessors"]) - 1

    def mesh(self, positions: ArrayLike, triangles: ArrayLike, **attributes: int) -> int:
        primitive = {
            "attributes": {"POSITION": self.array(positions), **attributes},
            "indices": self.array(np.ravel(triangles), "u2"),
        }
        self.document["meshes"].append({"primitives": [primitive]})
        return len(self.document["meshes"]) - 1

    def node(self, **entry: Any) -> int:
        self.document["nodes"].append(entry)
        return len(self.document["nodes"]) - 1

    def skin(self, joints: list[int], inverse_bind: NDArray[np.floating] | None = None) -> int:
        entry: dict[str, Any] = {"joints": joints}
        if inverse_bind is not None:  # column by column
            entry["inverseBindMatrices"] = self.array(np.swapaxes(inverse_bind, 1, 2))
        self.document.setdefault("skins", []).append(entry)
        return len(self.document["skins"]) - 1

    def animation(self, *channels: tuple[int, str, ArrayLike, ArrayLike, str], **more: Any) -> int:
        """Channels are node, path, times, values, interpolation."""
        entry: dict[str, Any] = {"channels": [], "samplers": [], **more}
        for node, path, times, values, interpolation in channels:
            entry["channels"].append(
                {"sampler": len(entry["samplers"]), "target": {"node": node, "path": path}}
            )
            sampler = {"input": self.array(times), "output": self.array(values)}
            entry["samplers"].append({**sampler, "interpolation": interpolation})
        self.document.setdefault("animations", []).append(entry)
        return len(self.document["animations"]) - 1

    def write(self, path: Path) -> Path:
        buffer: dict[str, Any] = {"byteLength": len(self.data)}
        document = {**self.document, "buffers": [buffer]}
        if path.suffix == ".glb":
            path.write_bytes(glb(json.dumps(document), self.data))
        else:
            buffer["uri"] = "data:;base64," + base64.b64encode(self.data).decode()
            path.write_text(json.dumps(document))
        return path


def bar_vertices() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """A square bar along +Y, from 0 to 2, without caps: positions, normals, triangles."""
    corners = np.array([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]]) * 0.1
    positions, normals, triangles = [], [], []
    for side in range(4):
        a, b = corners[side], corners[(side + 1) % 4]
        first = sum(map(len, positions))
        rows = [np.add([a, b], [0, y, 0]) for y in BAR_HEIGHTS]
        positions.append(np.reshape(rows, (-1, 3)))
        outward = (a + b) / np.linalg.norm(a + b)
        normals.append(np.broadcast_to(outward, positions[-1].shape))
        for k in range(len(BAR_HEIGHTS) - 1):
            p = first + 2 * k
            triangles += [[p, p + 2, p + 1], [p + 1, p + 2, p + 3]]
    return np.concatenate(positions), np.concatenate(normals), np.array(triangles)


def bar_weights(heights: NDArray[np.floating], *, smooth: bool) -> NDArray[np.float64]:
    """How much vertices at these heights follow the upper bone."""
    return np.clip(heights - 0.5, 0.0, 1.0) if smooth else (heights > 1.0).astype(np.float64)


def bar(*, smooth: bool = False, placed: bool = False) -> GltfFile:
    """A bar of two bones, the upper one from height 1, that bends by 90 degrees in a second.

    Nodes: 0 the root, 1 the lower bone, 2 the upper one, 3 the mesh. `placed`: its own node is
    elsewhere, which a skin does not follow.
    """
    file = GltfFile()
    positions, normals, triangles = bar_vertices()
    upper = bar_weights(positions[:, 1], smooth=smooth)
    none = np.zeros_like(upper)
    mesh = file.mesh(
        positions,
        triangles,
        NORMAL=file.array(normals),
        JOINTS_0=file.array(np.tile([0, 1, 0, 0], (len(upper), 1)), "u1"),
        WEIGHTS_0=file.array(np.stack([1.0 - upper, upper, none, none], axis=1)),
    )
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, 1, 3] = -1.0
    skin = file.skin([1, 2], inverse)
    file.node(children=[1, 3])
    file.node(children=[2])
    file.node(translation=[0, 1, 0])
    file.node(mesh=mesh, skin=skin, **({"translation": [5, 5, 5]} if placed else {}))
    file.animation((2, "rotation", [0.0, 1.0], [STILL, TURN], "LINEAR"), name="bend")
    return file


def face_normals(mesh: Mesh) -> NDArray[np.float64]:
    """(F, 3) unit normals of triangles, by their order of corners."""
    a, b, c = np.moveaxis(mesh.positions[mesh.triangles].astype(np.float64), 1, 0)
    normals = np.cross(b - a, c - a)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))
