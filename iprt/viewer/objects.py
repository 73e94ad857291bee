"""Objects as viewers list them, draw their gizmos and edit their materials."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.keyframes import ObjectMotion
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from iprt.scene.edits import ObjectEdit
from iprt.scene.objects import SceneObject
from iprt.scene.placement import bounds

Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ObjectState:
    """An object as it is at one moment. Nobody writes to its arrays.

    Attributes
    ----------
    name : str
    to_world : (4, 4) float64
        Where it is in the frame that is shown.
    corners : tuple of (3,) float64
        Lowest and highest of its mesh in that frame, before `to_world`.
    materials : tuple of Material
        Materials of its mesh, in the file's order, or the one that it was painted with.
    motion : ObjectMotion
        Where it is over time; `motion.to_world` is what `Engine.place` sets.
    time_s : float
        Time of that frame.
    mesh : Mesh
        In that frame.
    """

    name: str
    to_world: Float
    corners: tuple[Float, Float]
    materials: tuple[Material, ...]
    motion: ObjectMotion
    time_s: float
    mesh: Mesh

    @property
    def size(self) -> Float:
        """(3,) metres: sides of the object's own box."""
        low, high = self.corners
        return np.asarray((high - low) * np.linalg.norm(self.to_world[:3, :3], axis=0))

    @property
    def keyframed(self) -> bool:
        """Keyframes move it from `motion.to_world`."""
        return self.motion.moves

    def placed(self, to_world: Float) -> Float:
        """The argument of `Engine.place` that puts the object at `to_world` in this frame."""
        return self.motion.before(to_world, self.time_s)

    def edited(self, edit: ObjectEdit) -> ObjectState | None:
        """As it will be with an edit; None: not there."""
        if edit.removed:
            return None
        state = self
        if edit.to_world is not None:
            motion = replace(state.motion, to_world=np.reshape(np.array(edit.to_world), (4, 4)))
            state = replace(state, motion=motion, to_world=motion.at(state.time_s))
        if edit.material is not None:
            state = replace(state, materials=(edit.material,))
        return state


def object_states(
    objects: Iterable[SceneObject],
    instances: Iterable[Instance],
    time_s: float,
    known: Sequence[ObjectState],
) -> tuple[ObjectState, ...]:
    """States of all objects; what is `known` of the same meshes is not computed again."""
    corners = {id(state.mesh.positions): state.corners for state in known}
    states = []
    for entry, instance in zip(objects, instances, strict=True):
        mesh = instance.mesh
        if id(mesh.positions) not in corners:
            corners[id(mesh.positions)] = _corners(mesh)
        states.append(
            ObjectState(
                entry.name,
                _read_only(instance.to_world),
                corners[id(mesh.positions)],
                mesh.materials,
                entry.motion,
                time_s,
                mesh,
            )
        )
    return tuple(states)


def _corners(mesh: Mesh) -> tuple[Float, Float]:
    low, high = bounds(mesh)
    return _read_only(low), _read_only(high)


def _read_only(array: Float) -> Float:
    view = array.view()
    view.flags.writeable = False
    return view
