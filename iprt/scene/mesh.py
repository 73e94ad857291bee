"""Triangle meshes of virtual objects, and instances of them placed in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.scene.material import Material


@dataclass(frozen=True)
class Mesh:
    """Indexed triangles in object space.

    Attributes
    ----------
    positions, normals : (V, 3) float32
        Normals are unit length.
    uvs : (V, 2) float32
        Zero where the file has none.
    triangles : (F, 3) int32
        Counter-clockwise seen from outside.
    material_index : (F,) int32
        Into `materials`.
    materials : tuple of Material
        At least one.
    dropped : tuple of str
        What the file holds and this does not, one phrase each.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    triangles: NDArray[np.int32]
    material_index: NDArray[np.int32]
    materials: tuple[Material, ...]
    dropped: tuple[str, ...] = ()


def motion_between(
    previous: NDArray[np.float64], current: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(3, 4) affine map of world points of this frame to the frame before.

    Parameters
    ----------
    previous, current : (4, 4) float64
        `Instance.to_world` of an object in both.
    """
    if np.array_equal(previous, current):
        return np.eye(4)[:3]
    # The pseudo-inverse serves transforms that flatten.
    linear = previous[:3, :3] @ np.linalg.pinv(current[:3, :3])
    offset = previous[:3, 3] - linear @ current[:3, 3]
    return np.concatenate([linear, offset[:, None]], axis=1)


@dataclass(frozen=True)
class Instance:
    """A mesh placed in the world.

    Attributes
    ----------
    name : str
    mesh : Mesh
    to_world : (4, 4) float64
        `p_world = to_world @ p_object`, affine.
    """

    name: str
    mesh: Mesh
    to_world: NDArray[np.float64]
