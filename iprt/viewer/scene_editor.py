"""Edits of a scene's objects, which all clients share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import Material
from iprt.scene.clipboard import Copied, copied_objects, copy_objects, default_folder
from iprt.scene.light_tables import LightTable
from iprt.scene.manifest_writing import free_name
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.object_edits import ObjectEdit, flat, require_place
from iprt.viewer.core import Core
from iprt.viewer.object_states import ObjectState
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import World

Array = NDArray[np.float64]


class SceneEditor:
    """Editor of a scene's objects; each call is one step of undo.

    All methods are thread-safe, and return the number of the change unless they say otherwise.
    """

    def __init__(self, shared: SharedState, core: Core) -> None:
        self._shared, self._core = shared, core
        self._names: set[str] = set()  # names of added objects, some still loading
        self._groups: set[str] = set()  # names of added groups

    def place(self, places: Mapping[str, Array]) -> int:
        """Move objects to transforms (4, 4) by name; keyframes are relative to them.

        Raises
        ------
        SceneError
            Numbers are not finite, too large, or singular.
        """
        for name, to_world in places.items():
            require_place(name, to_world)
        return self._edit({name: {"to_world": flat(place)} for name, place in places.items()})

    def paint(self, materials: Mapping[str, Material]) -> int:
        """Give objects a single other material each."""
        return self._edit({name: {"material": one} for name, one in materials.items()})

    def shine(self, name: str, light: LightTable) -> int:
        """Change a light without geometry."""
        return self._edit({name: {"light": light}})

    def remove(self, names: Iterable[str]) -> int:
        """Remove objects."""
        return self._edit({name: {"removed": True} for name in names})

    def lock(self, names: Iterable[str], on: bool) -> int:
        """Lock objects against changes in viewers, or unlock them."""
        return self._edit({name: {"locked": on} for name in names})

    def group(self, names: Iterable[str], group: str) -> int:
        """Put objects into a group, "" for none."""
        return self._edit({name: {"group": group} for name in names})

    def free_group(self, wanted: str = "group") -> str:
        """Return a new name for a group, like the wanted one."""
        groups = {state.group for state in self._core.objects} | self._groups
        group = free_name(_stem(wanted), groups)
        self._groups.add(group)
        return group

    def rename(self, name: str, wanted: str) -> str:
        """Rename an object to the wanted name, or to a free one like it; return its name."""
        if wanted == name:
            return name
        new = self._free_name(wanted)

        def change(world: World) -> World:
            edit = replace(self._copy(world, name), name=new)
            if self._in_files(name):
                return world.edited(name, removed=True).having(edit)
            return world.without(name).having(edit)

        self._shared.edit(change)
        return new

    def duplicate(self, copies: Sequence[tuple[str, Array, str]]) -> list[str]:
        """Add copies of objects; return their names.

        Parameters
        ----------
        copies : sequence of (str, (4, 4) float64, str)
            Name of an object, and the transform and group of its copy.

        Raises
        ------
        SceneError
            Numbers are not finite, too large, or singular.
        """
        for name, to_world, _ in copies:
            require_place(name, to_world)
        names = [self._free_name(_stem(name)) for name, _, _ in copies]

        def change(world: World) -> World:
            for new, (name, to_world, group) in zip(names, copies, strict=True):
                edit = self._copy(world, name)
                edit = replace(edit, name=new, to_world=flat(to_world), group=group)
                world = world.having(edit)
            return world

        self._shared.edit(change)
        return names

    def copy(self, names: Sequence[str], done: Callable[[], None] = lambda: None) -> None:
        """Put objects on the clipboard (`iprt.scene.clipboard`), in the background."""
        edited = self._core.files.edited()
        if edited is None:
            return

        def job() -> Callable[[], None]:
            copy_objects(edited.origin, edited.text, edited.edits, names, default_folder())
            return done

        self._core.jobs.start("copying", job, self._core.note_problem)

    def paste(
        self, place: Array | None, done: Callable[[Sequence[str]], object] = lambda _: None
    ) -> None:
        """Add the objects of the clipboard, in the background.

        Parameters
        ----------
        place : (3,) float64 or None
            Point in the world for the centre of their bottom; None keeps their own place.
        done : callable
            Called by the engine's thread with the names of the new objects.
        """
        loaded = self._core.files.loaded
        nits = 1.0 if loaded is None else loaded.origin.manifest.nits

        def job() -> Callable[[], None]:
            copied = copied_objects(default_folder(), nits)
            moved = np.zeros(3) if place is None else place - copied.foot
            return lambda: self._add_copied(copied, moved, done)

        self._core.jobs.start("pasting", job, self._core.note_problem)

    def _add_copied(
        self, copied: Copied, moved: Array, done: Callable[[Sequence[str]], object]
    ) -> None:
        groups = {edit.group: self.free_group(edit.group) for edit in copied.edits if edit.group}
        added = []
        for edit in copied.edits:
            to_world = np.reshape(np.array(edit.to_world), (4, 4))
            to_world[:3, 3] += moved
            name = self._free_name(edit.name)
            group = groups.get(edit.group or "")
            added.append(replace(edit, name=name, to_world=flat(to_world), group=group))
        self._shared.edit(lambda world: reduce(World.having, added, world))
        if copied.lost:
            self._core.note_problem(f"pasted without animation: {', '.join(copied.lost)}")
        done([edit.name for edit in added])

    def settle(self, states: Sequence[ObjectState], *, align: bool) -> None:
        """Lower or lift objects onto the real surface below each; `status` reports problems.

        Parameters
        ----------
        states : sequence of ObjectState
        align : bool
            Align their +Y axes with the surface normals.
        """
        self._core.settle(states, align)

    def add(
        self,
        path: Path,
        yaw_deg: float,
        pitch_deg: float,
        *,
        pose: MeshPose | None = None,
        material: Material | None = None,
        done: Callable[[str | None], object] = lambda _: None,
    ) -> str:
        """Load a mesh, and place it on the surface seen in a direction once it is loaded.

        Parameters
        ----------
        path : Path
        yaw_deg, pitch_deg : float
            Direction in the axes of the capture centre.
        pose : MeshPose or None
            Orientation and size; by default as in `iprt scene add` without flags.
        material : Material or None
            By default the mesh file's own.
        done : callable
            Called by the engine's thread with the problem, or None once it is added.

        Returns
        -------
        str
            Name of the future object. `Engine.status` reports problems.
        """
        name = self._free_name(path.stem)
        edit = ObjectEdit(name, material=material, path=path)

        def finished(problem: str | None) -> None:
            self._names.discard(name)
            done(problem)

        self._core.add(edit, (yaw_deg, pitch_deg), pose or MeshPose(), finished)
        return name

    def add_light(self, light: LightTable, to_world: Array) -> str:
        """Add a light without geometry with a transform (4, 4), and return its name.

        Raises
        ------
        SceneError
            The numbers are not finite, too large, or singular.
        """
        require_place(light.kind, to_world)
        name = self._free_name(light.kind)
        self._edit({name: {"light": light, "to_world": flat(to_world)}})
        return name

    def _edit(self, parts: Mapping[str, Mapping[str, object]]) -> int:
        """Change these parts of the edits of objects, by name."""

        def change(world: World) -> World:
            for name, changed in parts.items():
                world = world.edited(name, **changed)
            return world

        return self._shared.edit(change)

    def _free_name(self, wanted: str) -> str:
        name = free_name(wanted, self._core.object_names() | self._names)
        self._names.add(name)
        return name

    @property
    def added(self) -> tuple[str, ...]:
        """Names of the objects that the files did not have when they were first read."""
        return tuple(e.name for e in self._shared.world.edits if not self._in_files(e.name))

    def _in_files(self, name: str) -> bool:
        loaded = self._core.files.loaded
        return loaded is not None and any(entry.name == name for entry in loaded.objects)

    def _copy(self, world: World, name: str) -> ObjectEdit:
        """Return the edit that makes a copy of an object; it still has the object's name."""
        edit = world.edit_of(name)
        return replace(edit, copy_of=name) if self._in_files(name) else edit


def _stem(name: str) -> str:
    """Return a name without the number of a copy."""
    stem, dash, number = name.rpartition("-")
    return stem if dash and number.isdigit() else name
