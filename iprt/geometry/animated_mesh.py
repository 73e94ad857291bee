"""Animated meshes of glTF files: rigid motion of nodes, and skinning."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.safe_reading import decoding
from iprt.geometry.animation import Skin, moved
from iprt.geometry.creases import face_normals, have_normals, with_normals
from iprt.geometry.gltf_clip import Clip, read_clip
from iprt.geometry.gltf_skin import require_few_vertices, skin_of
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.mesh_shapes import gltf_shapes
from iprt.geometry.meshes import Part, joined, part_of
from iprt.geometry.tangents import moved_tangents

LOG = logging.getLogger("iprt.scene")

FARTHEST_VERTEX = 1e18
"""Limit of the vertices' coordinates, the same as for static meshes."""


@dataclass(frozen=True)
class Piece:
    """A range of vertices that moves together.

    Attributes
    ----------
    vertices : slice
        Range of the vertices in the mesh.
    skin : Skin or None
        None if the vertices follow the node rigidly.
    """

    vertices: slice
    node: int
    skin: Skin | None


@dataclass(frozen=True)
class AnimatedMesh:
    """A mesh that an animation moves or deforms.

    Attributes
    ----------
    path : Path
        Source file.
    bound : Mesh
        Vertices as stored in the file, before nodes and joints place them (bind pose).
    flat : (K,) int64
        Vertices without a normal in the file; they take the normal of their face.
    faces : (K, 3) int64
        Vertex indices of these faces.
    """

    path: Path
    bound: Mesh
    clip: Clip
    pieces: tuple[Piece, ...]
    flat: NDArray[np.int64]
    faces: NDArray[np.int64]

    def at(self, time_s: float) -> Mesh:
        """Return the mesh at a time, in seconds; the animation loops.

        Raises
        ------
        FormatError
            The animation moves a vertex beyond `FARTHEST_VERTEX`.
        """
        pose = self.clip.pose(time_s)
        positions = np.empty(self.bound.positions.shape, np.float64)
        normals = np.empty_like(positions)
        known = self.bound.tangents
        tangents = None if known is None else np.empty(known.shape, np.float64)
        with np.errstate(all="ignore"):
            for piece in self.pieces:
                here = piece.vertices
                matrices = (
                    pose[piece.node][None, :3] if piece.skin is None else piece.skin.matrices(pose)
                )
                positions[here], normals[here] = moved(
                    self.bound.positions[here], self.bound.normals[here], matrices
                )
                if known is not None and tangents is not None:
                    tangents[here] = moved_tangents(known[here], matrices)
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
            tangents=None if tangents is None else tangents.astype(np.float32),
        )

    def _flat_normals(
        self, positions: NDArray[np.float64], moved: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the (K, 3) deformed face normals, on the side of the transformed normals."""
        along = moved[self.flat]
        now = face_normals(positions[self.faces])
        side = np.einsum("ki,ki->k", now, along)[:, None]
        return np.where(side == 0.0, along, np.copysign(1.0, side) * now)


def load_animated_mesh(
    path: Path, choice: str | int, material: Material | None = None, within: Path | None = None
) -> AnimatedMesh:
    """Load a glTF file with one of its animations.

    Parameters
    ----------
    path, material, within
        See `load_mesh`.
    choice : str or int
        Name or index of the animation.

    Raises
    ------
    FormatError
        As `load_mesh`, or if the animation is missing or damaged.
    """
    file = MeshFile(path, within)
    dropped = file.unread_parts(animated=True)
    with decoding(path, "cut off or damaged animation"):
        clip = read_clip(file, choice, dropped)
    with decoding(path, "cut off or damaged mesh file"), np.errstate(all="ignore"):
        pose = clip.pose(0.0)
        parts, pieces, flat, first = [], [], [np.zeros((0, 4), np.int64)], 0
        nodes = clip.skeleton.nodes
        for node, shape in gltf_shapes(file, nodes, colored=material is None):
            part = part_of(shape, np.eye(4)[None, :3], dropped)
            skin = skin_of(file, clip.bones, node, shape.primitive)
            part, lacking = _flattened(part)
            if skin is None and np.linalg.det(pose[node][:3, :3]) < 0.0:
                part.triangles = part.triangles[:, ::-1]
            if skin is not None:
                joints, weights = skin.joints[part.source], skin.weights[part.source]
                skin = replace(skin, joints=joints, weights=weights)
            flat.append(lacking + first)
            parts.append(part)
            pieces.append(Piece(slice(first, first + len(part.positions)), node, skin))
            first += len(part.positions)
        require_few_vertices(file, first)
        mesh = joined(file, parts, material, dropped)
    if mesh.triangles.shape[0] == 0:
        raise FormatError(f"{path}: holds no triangles")
    if any("morph" in phrase for phrase in mesh.dropped):
        LOG.warning("%s: morph targets are not read and have no effect", path)
    vertices = np.concatenate(flat)
    return AnimatedMesh(
        path, replace(mesh, deforms=True), clip, tuple(pieces), vertices[:, 0], vertices[:, 1:]
    )


def _flattened(part: Part) -> tuple[Part, NDArray[np.int64]]:
    """Return a part with flat normals where its file has none.

    Returns
    -------
    Part
    lacking : (K, 4) int64
        Index of each vertex without a normal of its own, then the three vertices of its face.
    """
    flat = np.ones(len(part.triangles), np.bool_)
    given = have_normals(part.normals)
    source, normals, triangles = with_normals(part.positions, part.normals, part.triangles, flat)
    corners = np.stack([triangles.ravel(), *np.repeat(triangles, 3, axis=0).T], axis=1)
    lacking = corners[~given[source[corners[:, 0]]]]
    return replace(part.taken(source, triangles), normals=normals), lacking
