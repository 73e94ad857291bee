"""Meshes of glTF files that an animation moves or bends."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.untrusted import decoding
from iprt.geometry.animation import Skin, moved
from iprt.geometry.creases import face_normals, have_normals, with_normals
from iprt.geometry.gltf_clip import Clip, read_clip
from iprt.geometry.gltf_numbers import part_node
from iprt.geometry.gltf_skin import require_few_vertices, skin_of
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.meshes import Part, joined, part_of, placed_geometries

LOG = logging.getLogger("iprt.scene")

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
            part = part_of(geometry, np.eye(4)[None, :3], dropped, material is None)
            skin = skin_of(file, clip.bones, node, geometry)
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
        LOG.warning("%s: morph targets are not read; what they change stays as it is", path)
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
        Each vertex without a normal of its own, and the three of its face.
    """
    flat = np.ones(len(part.triangles), np.bool_)
    given = have_normals(part.normals)
    source, normals, triangles = with_normals(part.positions, part.normals, part.triangles, flat)
    corners = np.stack([triangles.ravel(), *np.repeat(triangles, 3, axis=0).T], axis=1)
    lacking = corners[~given[source[corners[:, 0]]]]
    return replace(part.taken(source, triangles), normals=normals), lacking
