"""Edits of a scene's objects, which `iprt.scene.edit_writing` writes to `scene.toml`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.geometry.keyframes import ObjectKeyframe, ObjectMotion
from iprt.geometry.material import Material
from iprt.scene.light_tables import LightTable
from iprt.scene.manifest import allowed_transform
from iprt.scene.material_maps import MAPS
from iprt.scene.objects import AnyMesh, SceneLight, SceneObject, painted

Matrix = tuple[float, ...]
"""The 16 values of a (4, 4) transform, row-major."""


@dataclass(frozen=True)
class ObjectEdit:
    """An object's differences from the scene's files.

    Attributes
    ----------
    to_world : tuple of 16 float or None
        Replaces the object's own; keyframes are relative to it.
    material : Material or None
        Replaces the object's own materials.
    mesh : Mesh or AnimatedMesh or None
        The mesh of an object that the files do not have.
    path : Path or None
        Source file of `mesh`.
    removed : bool
        The object is removed.
    light : LightTable or None
        Replaces the object's own, or makes a new light without geometry.
    copy_of : str or None
        Name of the object in the files that a new object is a copy of.
    group : str or None
        Replaces the name of the object's group; "" for no group.
    locked : bool or None
        Replaces the object's lock.
    keyframes : tuple of ObjectKeyframe or None
        Replaces the object's own.
    maps : tuple of int
        Identities of the maps and variants of `material`, which comparisons of materials ignore.
    """

    name: str
    to_world: Matrix | None = None
    material: Material | None = None
    mesh: AnyMesh | None = field(default=None, compare=False)
    path: Path | None = None
    removed: bool = False
    light: LightTable | None = field(default=None, hash=False)  # has lists
    copy_of: str | None = None
    group: str | None = None
    locked: bool | None = None
    keyframes: tuple[ObjectKeyframe, ...] | None = field(default=None, hash=False)  # have lists
    maps: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        keys = () if self.material is None else (*MAPS, "variants")
        maps = tuple(id(getattr(self.material, key)) for key in keys)
        object.__setattr__(self, "maps", maps)

    def moved(self, motion: ObjectMotion) -> ObjectMotion:
        """Return a motion with the edit's placement and keyframes."""
        if self.to_world is not None:
            to_world = np.reshape(np.array(self.to_world, np.float64), (4, 4))
            motion = replace(motion, to_world=to_world)
        if self.keyframes is not None and self.keyframes is not motion.keyframes:
            motion = ObjectMotion.of(motion.to_world, self.keyframes)
        return motion

    def besides(self, saved: ObjectEdit | None) -> ObjectEdit | None:
        """Return the changes besides a saved edit of the object, or None without any."""
        if saved is None:
            return self
        same: dict[str, Any] = {
            part: None for part in VALUES if getattr(self, part) == getattr(saved, part)
        }
        return None if self == saved else replace(self, **same)


VALUES = ("to_world", "material", "light", "group", "locked", "keyframes")
"""Attributes of an edit that replace a value of the object; None leaves it."""


def flat(to_world: NDArray[np.float64]) -> Matrix:
    """Return a (4, 4) transform as a row-major tuple."""
    return tuple(float(value) for value in np.reshape(to_world, 16))


def require_place(name: str, to_world: NDArray[np.float64]) -> None:
    """Check that `scene.toml` may hold a (4, 4) transform.

    Raises
    ------
    SceneError
        It may not.
    """
    try:
        allowed_transform(list(flat(to_world)))
    except ValueError as problem:
        raise SceneError(f"{name} cannot be put there: {problem}") from None


def renamed(edits: Iterable[ObjectEdit]) -> dict[str, ObjectEdit]:
    """Return the edits that only give an object of the files another name, by the old name.

    They are the first copies of removed objects.
    """
    edits = tuple(edits)
    removed = {edit.name for edit in edits if edit.removed}
    found: dict[str, ObjectEdit] = {}
    for edit in edits:
        if edit.copy_of in removed and not edit.removed:
            found.setdefault(edit.copy_of, edit)
    return found


def edited_objects(
    objects: Sequence[SceneObject], edits: Iterable[ObjectEdit], nits: float
) -> tuple[SceneObject, ...]:
    """Return the objects with all edits applied; objects new to the scene come last.

    `nits` are the scene's.
    """
    by_name = {edit.name: edit for edit in edits}
    known = {entry.name: entry for entry in objects}
    names = renamed(by_name.values())
    found = [_edited(entry, names.get(entry.name) or by_name.get(entry.name)) for entry in objects]
    for edit in by_name.values():
        if edit.name in known or edit is names.get(edit.copy_of or ""):
            continue
        if edit.copy_of is not None and edit.copy_of in known:
            found.append(_edited(known[edit.copy_of], edit))
        elif edit.mesh is not None:
            entry = SceneObject(edit.name, edit.mesh, ObjectMotion(np.eye(4)))
            found.append(_edited(entry, edit))
        elif edit.copy_of is None and edit.light is not None:
            light = SceneLight(edit.light, nits)
            entry = SceneObject(edit.name, light.mesh(), ObjectMotion(np.eye(4)), light)
            found.append(_edited(entry, edit))
    return tuple(entry for entry in found if entry is not None)


def _edited(entry: SceneObject, edit: ObjectEdit | None) -> SceneObject | None:
    if edit is None:
        return entry
    if edit.removed:
        return None
    entry = replace(
        entry,
        name=edit.name,
        motion=edit.moved(entry.motion),
        group=entry.group if edit.group is None else edit.group,
        locked=entry.locked if edit.locked is None else edit.locked,
    )
    if edit.light is not None and entry.light is not None:
        light = replace(entry.light, table=edit.light)
        entry = replace(entry, light=light, mesh=light.mesh())
    if edit.material is not None:
        entry = replace(entry, mesh=painted(entry.mesh, edit.material))
    return entry
