"""Emitting triangles of the objects, at which rays are aimed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.bvh.scene import SceneBvh
from iprt.device.block import Block, Float4s, Float32, Int4s, Int32, when
from iprt.device.compute import ComputeDevice
from iprt.geometry.mesh import Instance, transformed
from iprt.world.objects.lamp_tree import TREE_FROM, lamp_tree, tree_levels


@dataclass(kw_only=True)
class LampsArgs(Block):
    """Emitting triangles of the objects (`cl/lib/world/objects/lamps.h`).

    Attributes
    ----------
    triangles : (count, 4) int32
        Instance, place in the packets, float bits of the share of the power up to and including
        the triangle, and its leaf in the tree. In the order of instances and places.
    count : int
    power : float
        Sum over the triangles of their area, in m², times the mean emission of their material.
    nodes : (N, 2, 4) float32 or None
    levels : int
        `LampTree`, above `TREE_FROM` triangles.
    """

    triangles: Int4s
    count: Int32
    power: Float32
    nodes: Float4s = when("LAMP_TREE")
    levels: Int32 = when("LAMP_TREE")


@dataclass(frozen=True)
class Emitters:
    """Emitting triangles of a scene.

    Attributes
    ----------
    places : (count, 2) int32
        Instance and place in the packets of each triangle.
    share : (count,) float32
        Share of the power up to and including each triangle.
    power : float
        As in `LampsArgs`.
    powers : (count,) float64
        Of each triangle.
    corners : (count, 3, 3) float64
        World space.
    """

    places: NDArray[np.int32]
    share: NDArray[np.float32]
    power: float
    powers: NDArray[np.float64]
    corners: NDArray[np.float64]


def emitters_of(scene: SceneBvh, instances: Sequence[Instance]) -> Emitters:
    """Return the emitting triangles, with areas in world space."""
    places, powers = [np.zeros((0, 2), np.int32)], [np.zeros(0)]
    triangles = [np.zeros((0, 3, 3))]
    for row, (index, (first, end)) in enumerate(
        zip(scene.instance_of, scene.places_of, strict=True)
    ):
        mesh = instances[index].mesh
        emission = np.mean([material.mean_emission for material in mesh.materials], axis=1)
        slots = scene.slots[first:end]
        (kept,) = np.nonzero(
            (slots >= 0) & (emission[mesh.material_index[np.maximum(slots, 0)]] > 0.0)
        )
        corners = mesh.positions[mesh.triangles[slots[kept]]].astype(np.float64)
        corners = transformed(instances[index].to_world, corners.reshape(-1, 3)).reshape(-1, 3, 3)
        triangles.append(corners)
        a, b, c = corners.transpose(1, 0, 2)
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        places.append(np.stack([np.full(len(kept), row), first + kept], axis=1).astype(np.int32))
        powers.append(area * emission[mesh.material_index[slots[kept]]])
    power = np.concatenate(powers)
    total = float(power.sum())
    share = np.cumsum(power) / max(total, np.finfo(np.float64).tiny)
    return Emitters(
        np.concatenate(places), share.astype(np.float32), total, power, np.concatenate(triangles)
    )


class Lamps:
    """Emitting triangles on the device.

    Parameters
    ----------
    device : ComputeDevice
    instances : sequence of Instance
        Their numbers of emitting triangles stay the same.
    """

    def __init__(self, device: ComputeDevice, instances: Sequence[Instance]) -> None:
        self._device = device
        most = max(emitting_triangles(instances), 1)
        self._triangles = device.zeros("lamp triangles", (most, 4), np.int32)
        self._count, self._power = 0, 0.0
        self._levels = tree_levels(most)
        self._nodes: cla.Array | None = None
        if most > TREE_FROM:
            self._nodes = device.zeros("lamp tree", (2 << self._levels, 2, 4))

    def load(self, scene: SceneBvh, instances: Sequence[Instance]) -> None:
        """Update the triangles' places and areas."""
        found = emitters_of(scene, instances)
        self._count, self._power = len(found.share), found.power
        rows = np.zeros(self._triangles.shape, np.int32)
        rows[: self._count, :2] = found.places
        rows[: self._count, 2] = found.share.view(np.int32)
        if self._nodes is not None and self._count:
            tree = lamp_tree(found.corners, found.powers)
            self._device.write(self._nodes, tree.nodes)
            rows[: self._count, 3] = tree.leaf_of
        self._device.write(self._triangles, rows)

    def arguments(self) -> LampsArgs:
        """Return the triangles for kernels. There are none without power."""
        return LampsArgs(
            triangles=self._triangles,
            count=self._count if 0.0 < self._power < np.inf else 0,
            power=self._power,
            nodes=self._nodes,
            levels=self._levels,
        )


def have_lamp_tree(instances: Sequence[Instance]) -> bool:
    """Return True if rays choose among the emitting triangles by a tree."""
    return emitting_triangles(instances) > TREE_FROM


def emitting_triangles(instances: Sequence[Instance]) -> int:
    """Return the number of triangles that emit light."""
    return sum(map(_emitting, instances))


def _emitting(instance: Instance) -> int:
    emits = np.array([material.emits for material in instance.mesh.materials])
    return int(emits[instance.mesh.material_index].sum())
