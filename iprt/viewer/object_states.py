"""States of objects for the viewers' lists, gizmos and material editors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.keyframes import ObjectKeyframe, ObjectMotion
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from iprt.scene.light_tables import LightTable
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.objects import SceneObject
from iprt.scene.placement import bounds
from iprt.viewer.keyframing import object_key, with_key

Float = NDArray[np.float64]
CORNERS = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)])


@dataclass(frozen=True, eq=False)
class ObjectState:
    """The state of an object at one moment; its arrays must not be written to.

    Attributes
    ----------
    name : str
    to_world : (4, 4) float64
        Transform in the displayed frame.
    corners : tuple of (3,) float64
        Lowest and highest corner of its mesh in that frame, before `to_world`.
    materials : tuple of Material
        Materials of its mesh in the file's order, or the single edited one.
    motion : ObjectMotion
        Motion over time; `Engine.place` sets `motion.to_world`.
    time_s : float
        Time of that frame.
    mesh : Mesh
        Mesh in that frame.
    light : LightTable or None
        A light without geometry.
    group : str
        Name of its group; "" for none.
    locked : bool
        True if it is locked against changes.
    """

    name: str
    to_world: Float
    corners: tuple[Float, Float]
    materials: tuple[Material, ...]
    motion: ObjectMotion
    time_s: float
    mesh: Mesh
    light: LightTable | None
    group: str = ""
    locked: bool = False

    @property
    def size(self) -> Float:
        """(3,) sides of the object-aligned box in metres."""
        low, high = self.corners
        return np.asarray((high - low) * np.linalg.norm(self.to_world[:3, :3], axis=0))

    @property
    def box(self) -> Float:
        """(8, 3) corners of the object-aligned box in the world."""
        low, high = self.corners
        corners = low + CORNERS * (high - low)
        return np.asarray(corners @ self.to_world[:3, :3].T + self.to_world[:3, 3])

    @property
    def middle(self) -> Float:
        """(3,) centre of the object-aligned box, before `to_world`."""
        return np.asarray(np.mean(self.corners, axis=0))

    @property
    def foot(self) -> Float:
        """(3,) pivot before `to_world`: centre of the bottom of that box; a light's own place."""
        if self.light is not None:
            return np.zeros(3)
        x, _, z = self.middle
        return np.array([x, self.corners[0][1], z])

    @property
    def pivot(self) -> Float:
        """(3,) point in the world that the object is moved by, turned and scaled about."""
        return np.asarray(self.to_world[:3, :3] @ self.foot + self.to_world[:3, 3])

    def about_pivot(self, linear: Float, pivot: Float | None = None) -> Float:
        """Return the transform (4, 4) of this linear part (3, 3) with the same or another pivot."""
        to_world = np.eye(4)
        to_world[:3, :3] = linear
        to_world[:3, 3] = (self.pivot if pivot is None else pivot) - linear @ self.foot
        return to_world

    @property
    def keyframed(self) -> bool:
        """True if keyframes move the object."""
        return self.motion.moves

    def placed(self, to_world: Float) -> Float:
        """Return the argument of `Engine.place` that leads to `to_world` in this frame."""
        return self.motion.before(to_world, self.time_s)

    def keyed(self, to_world: Float) -> tuple[ObjectKeyframe, ...]:
        """Return the keyframes that lead to `to_world` in this frame.

        Raises
        ------
        SceneError
            The scene format does not allow them.
        """
        key = object_key(self.motion, to_world, self.time_s)
        return with_key(self.motion.keyframes, key)

    def edited(self, edit: ObjectEdit) -> ObjectState | None:
        """Return the state with an edit; None if the object is removed."""
        if edit.removed:
            return None
        state, motion = self, edit.moved(self.motion)
        if motion is not self.motion:
            state = replace(state, motion=motion, to_world=motion.at(state.time_s))
        if edit.material is not None:
            state = replace(state, materials=(edit.material,))
        if edit.light is not None:
            state = replace(state, light=edit.light)
        if edit.group is not None:
            state = replace(state, group=edit.group)
        return state if edit.locked is None else replace(state, locked=edit.locked)


def object_states(
    objects: Iterable[SceneObject],
    instances: Iterable[Instance],
    time_s: float,
    known: Sequence[ObjectState],
) -> tuple[ObjectState, ...]:
    """Return the states of all objects, reusing bounds of the same meshes from `known`."""
    corners = {id(state.mesh.positions): state.corners for state in known}
    states = []
    for entry, instance in zip(objects, instances, strict=True):
        mesh = instance.mesh
        if id(mesh.positions) not in corners:
            corners[id(mesh.positions)] = bounds(mesh)
        states.append(
            ObjectState(
                entry.name,
                instance.to_world,
                corners[id(mesh.positions)],
                mesh.materials,
                entry.motion,
                time_s,
                mesh,
                None if entry.light is None else entry.light.table,
                entry.group,
                entry.locked,
            )
        )
    return tuple(states)
