"""Nodes and skins of a glTF file.

Specification: Khronos glTF 2.0, sections 3.5 (scenes), 3.7.3 (skins).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from iprt.errors import FormatError
from iprt.geometry.animation import Float, Node, Skin
from iprt.geometry.gltf_check import accessor_of
from iprt.geometry.gltf_document import MAX_NODES, Gltf, Primitive, parsed_part
from iprt.geometry.gltf_part import Index, Part
from iprt.geometry.mesh_files import MeshFile

INFLUENCES = (0, 1)
"""Sets of four joints per vertex that are read (JOINTS_0, JOINTS_1)."""
MAX_BENT_VERTICES = 2**21
"""Limit for deformed vertices; each takes some hundred bytes."""


class _Skin(Part):
    joints: Annotated[list[Index], Field(min_length=1, max_length=MAX_NODES)]
    inverse_bind_matrices: Index | None = None


@dataclass(frozen=True)
class Bones:
    """The joints of a skin with their inverse bind matrices.

    Attributes
    ----------
    nodes : (J,) int64
    inverse_bind : (J, 4, 4) float64
    """

    nodes: NDArray[np.int64]
    inverse_bind: Float


def scene_nodes(gltf: Gltf) -> dict[int, Node]:
    """Return the nodes of the file's scene by index, parents first."""
    nodes: dict[int, Node] = {}
    level = [(-1, index) for index in gltf.roots()]
    while level:
        for parent, index in level:
            entry = gltf.nodes[index]
            given = {
                key: np.array(value, np.float64)
                for key in ("translation", "rotation", "scale")
                if (value := getattr(entry, key)) is not None
            }
            if "rotation" in given:
                given["rotation"] = unit_quaternions(given["rotation"], f"nodes[{index}].rotation")
            matrix = None
            if entry.matrix is not None:
                matrix = np.array(entry.matrix, np.float64).reshape(4, 4).T  # column-major
            nodes[index] = Node(parent, **given, matrix=matrix)
        level = [(index, child) for _, index in level for child in gltf.nodes[index].children]
    return nodes


def read_bones(file: MeshFile, nodes: dict[int, Node]) -> dict[int, Bones]:
    """Read the skins used by nodes of the scene, by index.

    Parameters
    ----------
    nodes : dict of int to Node
        All nodes of the scene, as `scene_nodes` returns them.

    Raises
    ------
    ValueError
        A skin, or the joints and weights of vertices, are damaged; the message is one line.
    """
    assert file.gltf is not None
    used = dict.fromkeys(file.gltf.nodes[index].skin for index in nodes)
    bones = {skin: _bones(file, skin, nodes) for skin in used if skin is not None}
    if bones:
        _check_joints(file.gltf)
    return bones


def require_few_vertices(file: MeshFile, count: int) -> None:
    """Raise FormatError if `count` exceeds the limit for deformed vertices."""
    if count > MAX_BENT_VERTICES:
        raise FormatError(
            f"{file.path}: {count} vertices that move; at most {MAX_BENT_VERTICES} are read"
        )


def _bones(file: MeshFile, number: int, nodes: dict[int, Node]) -> Bones:
    assert file.gltf is not None
    where = f"skins[{number}]"
    if number >= len(file.gltf.skins):
        raise ValueError(f"there is no skin {number}")
    skin = parsed_part(_Skin, file.gltf.skins[number], where)
    for joint in skin.joints:
        if joint not in nodes:
            raise ValueError(f"{where}: joint {joint} is no node of the scene")
    count = len(skin.joints)
    inverse_bind = np.broadcast_to(np.eye(4), (count, 4, 4))
    if skin.inverse_bind_matrices is not None:
        given = file.values(skin.inverse_bind_matrices, ("MAT4",), f"{where}.matrices")
        if len(given) < count:
            raise ValueError(f"{where}: {len(given)} inverse bind matrices for {count} joints")
        inverse_bind = given[:count].reshape(count, 4, 4).transpose(0, 2, 1)
    return Bones(np.array(skin.joints, np.int64), inverse_bind)


def _check_joints(gltf: Gltf) -> None:
    """Raise ValueError if joints or weights of vertices do not match each other or the vertices."""
    for number, mesh in enumerate(gltf.meshes):
        for primitive in mesh.primitives:
            for influence in INFLUENCES:
                names = [f"{kind}_{influence}" for kind in ("JOINTS", "WEIGHTS")]
                given = [name for name in names if name in primitive.attributes]
                where = f"meshes[{number}]"
                if len(given) == 1:
                    raise ValueError(f"{where}: {given[0]} without the other of {', '.join(names)}")
                count = gltf.accessors[primitive.attributes["POSITION"]].count
                for name in given:
                    index = primitive.attributes[name]
                    found = accessor_of(gltf, index, ("VEC4",), f"{where}.{name}").count
                    if found != count:
                        raise ValueError(f"{where}.{name}: {found} of VEC4; expected {count}")


def unit_quaternions(quaternions: Float, where: str) -> Float:
    """Return quaternions (..., 4) scaled to unit length, or raise ValueError if one is zero."""
    length = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    if not (length > 1e-6).all():
        raise ValueError(f"{where}: a quaternion of no length")
    return np.asarray(quaternions / length)


def skin_of(
    file: MeshFile, bones: dict[int, Bones], node: int, primitive: Primitive | None
) -> Skin | None:
    """Return the skin of a node's primitive, or None if the primitive follows the node.

    Raises
    ------
    ValueError
        Joints or weights are unusable.
    """
    assert file.gltf is not None
    number = file.gltf.nodes[node].skin
    if number is None or number not in bones or primitive is None:
        return None
    given, where = primitive.attributes, f"nodes[{node}]: skin {number}"
    sets = [influence for influence in INFLUENCES if f"JOINTS_{influence}" in given]
    if not sets:
        return None
    if any(file.gltf.accessors[given[f"JOINTS_{i}"]].dtype.kind == "f" for i in sets):
        raise ValueError(f"{where}: joints that are no whole numbers")

    def rows(kind: str) -> Float:
        indices = [given[f"{kind}_{influence}"] for influence in sets]
        whole = kind == "WEIGHTS"
        values = [file.values(i, ("VEC4",), where, finite=False, fractions=whole) for i in indices]
        return np.concatenate(values, axis=1)

    joints, weights = rows("JOINTS"), rows("WEIGHTS")
    found = bones[number]
    return Skin(found.nodes, found.inverse_bind, *_checked(found, joints, weights, where))


def _checked(
    bones: Bones, joints: NDArray[np.float64], weights: NDArray[np.float64], where: str
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return usable joints and weights (V, I), with weights normalised.

    Raises
    ------
    ValueError
        Joints or weights are out of range or not finite.
    """
    if not (np.isfinite(weights).all() and (weights >= 0.0).all()):
        raise ValueError(f"{where}: weights that are NaN, infinite or negative")
    numbers = np.where(weights > 0.0, joints.astype(np.int64), 0)
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(bones.nodes):
        raise ValueError(f"{where}: joint {numbers.max()} of {len(bones.nodes)}")
    total = weights.sum(axis=1, keepdims=True)
    # A vertex without weights follows the first joint.
    first = np.zeros_like(weights)
    first[:, :1] = 1.0
    shares = np.divide(weights, total, out=first, where=total > 0.0)
    return numbers, shares
