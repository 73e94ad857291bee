"""Triangle meshes of virtual objects, and instances of them placed in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.geometry.light import Light
from iprt.geometry.material import Material
from iprt.geometry.place import Place
from iprt.geometry.tangents import with_tangents

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """A mesh of indexed triangles in object space.

    Attributes
    ----------
    positions, normals : (V, 3) float32
        Normals are unit length.
    uvs : (V, 2) float32
        Zero where the file has none.
    triangles : (F, 3) int32
        Counter-clockwise seen from outside.
    material_index : (F,) int32
        Indices into `materials`.
    materials : tuple of Material
        At least one, except of lights.
    dropped : tuple of str
        Unread contents of the file, one phrase each.
    warnings : tuple of str
        Missing or unsupported material properties that change the look much, one line each.
    deforms : bool
        True if an animation changes positions and normals.
    tangents : (V, 4) float32 or None
        Unit vectors along u of the normal map, or 0, and the sign of the bitangent
        (`with_tangents`); None without normal maps.
    light : Light or None
        A light without geometry, which this is instead of triangles.
    uvs2 : (V, 2) float32 or None
        A second set of texture coordinates; None if no material has a map there.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    triangles: NDArray[np.int32]
    material_index: NDArray[np.int32]
    materials: tuple[Material, ...]
    dropped: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    deforms: bool = False
    tangents: NDArray[np.float32] | None = None
    light: Light | None = None
    uvs2: NDArray[np.float32] | None = None


def tangent_mesh(mesh: Mesh, place: Place | None = None) -> Mesh:
    """Return a mesh with tangents for a normal map at a place, by default at `uvs`.

    Vertices where they differ are split.
    """
    uvs = mesh.uvs if place is None else place.coordinates(mesh.uvs, mesh.uvs2)
    source, tangents, triangles = with_tangents(
        mesh.positions.astype(np.float64),
        mesh.normals.astype(np.float64),
        uvs,
        mesh.triangles.astype(np.int64),
    )
    return replace(
        mesh,
        positions=mesh.positions[source],
        normals=mesh.normals[source],
        uvs=mesh.uvs[source],
        uvs2=None if mesh.uvs2 is None else mesh.uvs2[source],
        triangles=triangles.astype(np.int32),
        tangents=tangents.astype(np.float32),
    )


def light_mesh(light: Light) -> Mesh:
    """Return a light as the mesh of an object. Its vertices are the corners of a box around it."""
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    corners = (signs * light.reach).astype(np.float32)
    return Mesh(
        positions=corners,
        normals=np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(corners), 1)),
        uvs=np.zeros((len(corners), 2), np.float32),
        triangles=np.zeros((0, 3), np.int32),
        material_index=np.zeros(0, np.int32),
        materials=(),
        light=light,
    )


def transformed(matrix: Float, points: NDArray[np.floating]) -> Float:
    """Return points (..., 3) after an affine transform (4, 4)."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3], np.float64)


def cofactors(linear: Float) -> Float:
    """Return the (..., 3, 3) cofactor matrices: the determinant times the inverse transpose.

    They transform normals, and exist for singular transforms too.
    """
    rows = [np.cross(linear[..., i - 2, :], linear[..., i - 1, :]) for i in range(3)]
    return np.stack(rows, axis=-2)


def motion_between(previous: Float, current: Float) -> Float:
    """Return the (3, 4) affine map of world points from this frame to the previous one.

    Parameters
    ----------
    previous, current : (4, 4) float64
        `Instance.to_world` of an object in both frames.
    """
    if np.array_equal(previous, current):
        return np.eye(4)[:3]
    # The pseudo-inverse also handles singular transforms.
    linear = previous[:3, :3] @ np.linalg.pinv(current[:3, :3])
    offset = previous[:3, 3] - linear @ current[:3, 3]
    return np.concatenate([linear, offset[:, None]], axis=1)


@dataclass(frozen=True)
class Instance:
    """A mesh placed in the world.

    Attributes
    ----------
    to_world : (4, 4) float64
        `p_world = to_world @ p_object`, affine.
    """

    name: str
    mesh: Mesh
    to_world: Float


def row_owners(instances: Sequence[Instance]) -> NDArray[np.int32]:
    """Return the instance of each row of the `table_rows` of all instances' materials, (M,)."""
    materials = [len(instance.mesh.materials) for instance in instances]
    variants = [sum(len(one.palette) for one in instance.mesh.materials) for instance in instances]
    numbers = np.arange(len(instances), dtype=np.int32)
    return np.concatenate([np.repeat(numbers, materials), np.repeat(numbers, variants)])


def require_same_objects(before: Sequence[Instance], after: Sequence[Instance]) -> None:
    """Raise SceneError unless these are the same objects, possibly moved.

    Objects are the same if their names, order, triangles and materials agree. The vertices must
    agree too unless the mesh deforms. Lights may change, but for their profiles.
    """
    names, others = ([instance.name for instance in those] for those in (before, after))
    if names != others:
        raise SceneError(
            f"cannot move {', '.join(others) or 'nothing'}: the objects are, in this order, "
            f"{', '.join(names) or 'none'}"
        )
    for old, new in zip(before, after, strict=True):
        if new.to_world.shape != (4, 4) or not np.isfinite(new.to_world).all():
            raise SceneError(f"object {new.name}: to_world must be 4x4 finite numbers")
        if old.mesh is not new.mesh and not _same_shape(old.mesh, new.mesh):
            raise SceneError(
                f"object {new.name}: cannot move, its triangles, vertices or materials are others "
                "than before; make a new renderer"
            )


def same_places(before: Sequence[Instance], after: Sequence[Instance]) -> bool:
    """Return True if no object moved, deformed or shines otherwise in the second of two states."""
    return all(
        np.array_equal(old.to_world, new.to_world)
        and old.mesh.light == new.mesh.light
        and (old.mesh is new.mesh or _equal(old.mesh, new.mesh, "positions", "normals"))
        for old, new in zip(before, after, strict=True)
    )


def _same_kind(old: Light | None, new: Light | None) -> bool:
    """Return True if both are lights of the same profile, or neither is a light."""
    if old is None or new is None:
        return old is new
    return old.profile is new.profile


def _same_shape(old: Mesh, new: Mesh) -> bool:
    # The vertices of a light are a mark of where it is.
    varies = old.deforms or old.light is not None
    vertices = () if varies else ("positions", "normals")
    return (
        old.deforms == new.deforms
        and old.positions.shape == new.positions.shape
        and _equal(old, new, "uvs", "uvs2", "triangles", "material_index", *vertices)
        and _same_kind(old.light, new.light)
        and old.materials == new.materials
        and all(
            one is other
            for a, b in zip(old.materials, new.materials, strict=True)
            for one, other in zip((*a.maps, a.variants), (*b.maps, b.variants), strict=True)
        )
    )


def _equal(old: Mesh, new: Mesh, *names: str) -> bool:
    """Return True if these arrays of both meshes are equal; most are the same object."""
    pairs = ((getattr(old, name), getattr(new, name)) for name in names)
    return all(a is b or np.array_equal(a, b) for a, b in pairs)
