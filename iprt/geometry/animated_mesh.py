"""Meshes of glTF files that an animation moves or bends."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.untrusted import decoding
from iprt.geometry.animation import Skin, moved
from iprt.geometry.creases import face_normals, have_normals, with_normals
from iprt.geometry.gltf_clip import Bones, Clip, read_clip
from iprt.geometry.gltf_numbers import JOINT_KEYS, WEIGHT_KEYS, part_node
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.meshes import Part, joined, part_of, placed_geometries

LOG = logging.getLogger("iprt.scene")

MAX_ANIMATED_VERTICES = 2**21
"""Each takes some hundred bytes while it is bent, in every frame."""
FARTHEST_VERTEX = 1e18
"""The limit of meshes at rest, too."""


@dataclass(frozen=True)
class Piece:
    """Vertices that move together.

    Attributes
    ----------
    vertices : slice
        Where they are among the mesh's.
    skin : Skin or None
        None: they follow the node.
    """

    vertices: slice
    node: int
    skin: Skin | None


@dataclass(frozen=True)
class AnimatedMesh:
    """A mesh over time.

    Attributes
    ----------
    path : Path
        The file it was read from.
    bound : Mesh
        Vertices as the file has them, before nodes and joints place them.
    flat : (K,) int64
        Vertices whose normals are those of their faces, which the file has none for.
    faces : (K, 3) int64
        The vertices of these faces.
    """

    path: Path
    bound: Mesh
    clip: Clip
    pieces: tuple[Piece, ...]
    flat: NDArray[np.int64]
    faces: NDArray[np.int64]

    def at(self, time_s: float) -> Mesh:
        """The mesh at a time, counted anew after each round of the animation.

        Raises
        ------
        FormatError
            The animation takes vertices out of all bounds.
        """
        pose = self.clip.pose(time_s)
        positions = np.empty(self.bound.positions.shape, np.float64)
        normals = np.empty_like(positions)
        with np.errstate(all="ignore"):
            for piece in self.pieces:
                here = piece.vertices
                matrices = (
                    pose[piece.node][None, :3] if piece.skin is None else piece.skin.matrices(pose)
                )
                positions[here], normals[here] = moved(
                    self.bound.positions[here], self.bound.normals[here], matrices
                )
        if not (np.abs(positions) < FARTHEST_VERTEX).all():
            raise FormatError(
                f"{self.path}: animation '{self.clip.name}' takes vertices out of all bounds at "
                f"{time_s:g} s"
            )
        normals[self.flat] = self._flat_normals(positions, normals)
        return replace(
            self.bound,
            positions=positions.astype(np.float32),
            normals=normals.astype(np.float32),
        )

    def _flat_normals(
        self, positions: NDArray[np.float64], moved: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(K, 3) of the faces as they are bent now, on the side of those that moved along."""
        along = moved[self.flat]
        now = face_normals(positions[self.faces])
        side = np.einsum("ki,ki->k", now, along)[:, None]
        return np.where(side == 0.0, along, np.copysign(1.0, side) * now)


def load_animated_mesh(
    path: Path, choice: str | int, material: Material | None = None, within: Path | None = None
) -> AnimatedMesh:
    """Load a glTF file with one of its animations, by name or number; else as `load_mesh`.

    Raises
    ------
    FormatError
        As of `load_mesh`; no such animation, or one that is damaged.
    """
    file = MeshFile(path, within)
    dropped = file.unread_parts(animated=True)
    with decoding(path, "cut off or damaged animation"):
        clip = read_clip(file, choice, dropped)
    with decoding(path, "cut off or damaged mesh file"), np.errstate(all="ignore"):
        pose = clip.pose(0.0)
        parts, pieces, flat, first = [], [], [np.zeros((0, 4), np.int64)], 0
        placed = placed_geometries(file, dropped)
        for name, (_, geometry) in placed.items():
            node = part_node(name)
            part = part_of(geometry, np.eye(4), dropped)
            skin = _skin(file, clip, node, geometry)
            part, source, lacking = _flattened(part)
            if skin is None and np.linalg.det(pose[node][:3, :3]) < 0.0:
                part.triangles = part.triangles[:, ::-1]
            if skin is not None:
                skin = replace(skin, joints=skin.joints[source], weights=skin.weights[source])
            flat.append(lacking + first)
            parts.append(part)
            pieces.append(Piece(slice(first, first + len(part.positions)), node, skin))
            first += len(part.positions)
        if first > MAX_ANIMATED_VERTICES:
            raise FormatError(
                f"{path}: {first} vertices; at most {MAX_ANIMATED_VERTICES} are animated"
            )
        mesh = joined(file, parts, material, dropped)
    if mesh.triangles.shape[0] == 0:
        raise FormatError(f"{path}: holds no triangles")
    if any("morph" in phrase for phrase in mesh.dropped):
        LOG.warning("%s: morph targets are not read; what they change stays as it is", path)
    vertices = np.concatenate(flat)
    return AnimatedMesh(
        path, replace(mesh, deforms=True), clip, tuple(pieces), vertices[:, 0], vertices[:, 1:]
    )


def _flattened(part: Part) -> tuple[Part, NDArray[np.int64], NDArray[np.int64]]:
    """A part with flat normals where its file has none.

    Returns
    -------
    Part
    source : (V,) int64
        The vertex of the file that each comes from.
    lacking : (K, 4) int64
        Each vertex without a normal of its own, and the three of its face.
    """
    flat = np.ones(len(part.triangles), np.bool_)
    given = have_normals(part.normals)
    source, normals, triangles = with_normals(part.positions, part.normals, part.triangles, flat)
    corners = np.stack([triangles.ravel(), *np.repeat(triangles, 3, axis=0).T], axis=1)
    lacking = corners[~given[source[corners[:, 0]]]]
    made = replace(
        part,
        positions=part.positions[source],
        normals=normals,
        uvs=part.uvs[source],
        triangles=triangles,
    )
    return made, source, lacking


def _skin(file: MeshFile, clip: Clip, node: int, geometry: Any) -> Skin | None:
    """The skin of a node's geometry, if it has one."""
    assert file.gltf is not None
    number = file.gltf.nodes[node].skin
    if number is None:
        return None
    given = geometry.vertex_attributes
    pairs = [pair for pair in zip(JOINT_KEYS, WEIGHT_KEYS, strict=True) if pair[0] in given]
    sets = [(given[joints], given[weights]) for joints, weights in pairs]
    if not sets:
        return None
    bones = clip.bones[number]
    count = len(geometry.vertices)
    where = f"nodes[{node}]: skin {number}"
    joints = np.concatenate([_table(j, count, f"{where}: joints") for j, _ in sets], axis=1)
    weights = np.concatenate([_fractions(w, count, f"{where}: weights") for _, w in sets], axis=1)
    return Skin(bones.nodes, bones.inverse_bind, *_checked(bones, joints, weights, where))


def _checked(
    bones: Bones, joints: NDArray[np.generic], weights: NDArray[np.float64], where: str
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Joints and weights (V, I) that can be used.

    Raises
    ------
    ValueError
        They cannot.
    """
    if not (np.isfinite(weights).all() and (weights >= 0.0).all()):
        raise ValueError(f"{where}: weights that are NaN, infinite or negative")
    if joints.dtype.kind not in "iu":
        raise ValueError(f"{where}: joints that are no whole numbers")
    numbers = np.where(weights > 0.0, joints.astype(np.int64), 0)
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(bones.nodes):
        raise ValueError(f"{where}: joint {numbers.max()} of {len(bones.nodes)}")
    total = weights.sum(axis=1, keepdims=True)
    # A vertex without weights follows the first joint.
    first = np.zeros_like(weights)
    first[:, :1] = 1.0
    shares = np.divide(weights, total, out=first, where=total > 0.0)
    return numbers, shares


def _table(values: Any, count: int, where: str) -> NDArray[np.generic]:
    table: NDArray[np.generic] = np.asarray(values)
    if table.shape != (count, 4):
        raise ValueError(f"{where} of {table.shape}; there are {count} vertices of 4")
    return table


def _fractions(values: Any, count: int, where: str) -> NDArray[np.float64]:
    """Integers stand for fractions of their largest."""
    table = _table(values, count, where)
    if table.dtype.kind not in "iu":
        return table.astype(np.float64)
    return table.astype(np.float64) / float(2 ** (8 * table.dtype.itemsize) - 1)
