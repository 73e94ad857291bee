"""The selected objects of a window, which are moved, painted and removed as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.scene.object_edits import require_place
from iprt.viewer.engine import Engine
from iprt.viewer.object_states import ObjectState

Array = NDArray[np.float64]


class Selection:
    """The selection of one window, for use by the interface's thread.

    Edits apply to all selected objects that are not locked. Motion is about the pivot of the
    primary one, which was selected last.

    Parameters
    ----------
    engine : Engine
    say : callable
        `UiState.say`, which shows a line to the user.

    Attributes
    ----------
    names : tuple of str
        Selected objects; the primary one is last, and may still be loading.
    sun : bool
        The sun is selected in place of objects.
    whole_groups : bool
        Select all objects of a group with any of them.
    recording : bool
        Moving objects sets keys at the displayed frame, instead of moving their whole motions.
    """

    def __init__(self, engine: Engine, say: Callable[..., None]) -> None:
        self._engine, self._say = engine, say
        self.names: tuple[str, ...] = ()
        self.sun, self.whole_groups, self.recording = False, True, False

    # Selected objects -------------------------------------------------------------------------

    @property
    def primary(self) -> str | None:
        """Name of the object that was selected last."""
        return self.names[-1] if self.names else None

    def select(self, *names: str) -> None:
        """Select these objects, with their groups; the last one becomes the primary one."""
        self.sun = False
        self.names = tuple(dict.fromkeys((*self._grouped(names), *names)))
        if names:
            self.names = (*(name for name in self.names if name != names[-1]), names[-1])

    def toggle(self, name: str) -> None:
        """Add an object to the selection, or take it out, with its group."""
        if name in self.names:
            out = {name, *self._grouped([name])}
            self.select(*(other for other in self.names if other not in out))
        else:
            self.select(*self.names, name)

    def select_all(self) -> None:
        """Select all objects that are not locked."""
        self.select(*(state.name for state in self._engine.objects if not state.locked))

    def _grouped(self, names: Sequence[str]) -> list[str]:
        if not self.whole_groups:
            return []
        states = self._engine.objects
        groups = {state.group for state in states if state.name in names and state.group}
        return [state.name for state in states if state.group in groups]

    @property
    def state(self) -> ObjectState | None:
        """The primary object with all edits."""
        return self._engine.object_state(self.primary)

    @property
    def states(self) -> list[ObjectState]:
        """The selected objects with all edits."""
        found = (self._engine.object_state(name) for name in self.names)
        return [state for state in found if state is not None]

    def unlocked(self) -> list[ObjectState]:
        """Return the selected objects that are not locked; report if all are."""
        states = self.states
        free = [state for state in states if not state.locked]
        if states and not free:
            self._say(f"{states[-1].name} is locked", bad=True)
        return free

    # Edits of all selected objects --------------------------------------------------------------

    def place(self, state: ObjectState, to_world: Array) -> None:
        """Move an object to a transform (4, 4) in the displayed frame, and the others with it."""
        try:
            require_place(state.name, to_world)
            moved = to_world @ np.linalg.inv(state.to_world)
            places = [
                (other, to_world if other.name == state.name else moved @ other.to_world)
                for other in self.unlocked()
            ]
            if self.recording:
                self._engine.animate({o.name: o.keyed(place) for o, place in places}, {})
            else:
                self._engine.editor.place({o.name: o.placed(place) for o, place in places})
        except IprtError as error:
            self._say(str(error), bad=True)

    def paint(self, **part: Any) -> None:
        """Change attributes of the objects' materials."""
        self._engine.editor.paint(
            {
                state.name: state.materials[0].edited(**part)
                for state in self.unlocked()
                if state.light is None
            }
        )

    def remove(self) -> None:
        """Remove the objects."""
        if names := [state.name for state in self.unlocked()]:
            self._engine.editor.remove(names)
            back = "it" if len(names) == 1 else "them"
            self._say(f"{listed(names)} removed; Ctrl+Z brings {back} back")
            self.select()

    def rename(self, name: str) -> None:
        """Rename the primary object; a name that is taken gets a number."""
        old = self.primary
        if old is None or not name.strip() or self._engine.object_state(old) is None:
            return
        new = self._engine.editor.rename(old, name)
        self.names = tuple(new if known == old else known for known in self.names)

    def lock(self, on: bool) -> None:
        """Lock the objects, or unlock them."""
        self._engine.editor.lock([state.name for state in self.states], on)

    def group(self) -> None:
        """Make the objects a group."""
        if len(names := [state.name for state in self.states]) > 1:
            self._engine.editor.group(names, self._engine.editor.free_group())
        else:
            self._say("first select several objects, with Ctrl", bad=True)

    def ungroup(self) -> None:
        """Dissolve the groups of the objects."""
        self._engine.editor.group([state.name for state in self.states if state.group], "")

    def settle(self, *, align: bool) -> None:
        """Lower or lift each object onto the surface below it; see `SceneEditor.settle`."""
        self._engine.editor.settle(
            [state for state in self.unlocked() if state.light is None], align=align
        )

    # Copies -----------------------------------------------------------------------------------

    def duplicate(self, right: Array) -> None:
        """Add a copy of each object beside all of them, and select the copies.

        Parameters
        ----------
        right : (3,) float64
            Unit vector in the world.
        """
        states = self.states
        if not states:
            return
        extent = np.concatenate([state.box @ right for state in states])
        step = 1.1 * (extent.max() - extent.min() or 0.25) * right
        self.select(*self._copies(states, [step]))

    def array(self, count: int, step: Sequence[float]) -> None:
        """Repeat the objects along a line.

        Parameters
        ----------
        count : int
            Number of each object after that, with the object itself.
        step : (x, y, z)
            Distance of neighbours, metres in the world.
        """
        steps = [number * np.array(step, np.float64) for number in range(1, count)]
        self.select(*self.names, *self._copies(self.states, steps))

    def _copies(self, states: Sequence[ObjectState], steps: Sequence[Array]) -> list[str]:
        """Add a copy of each object at each step; return the names."""
        editor, copies = self._engine.editor, []
        for step in steps:
            groups = {state.group: "" for state in states}
            for group in filter(None, groups):
                groups[group] = editor.free_group(group)
            for state in states:
                to_world = state.to_world.copy()
                to_world[:3, 3] += step
                copies.append((state.name, state.placed(to_world), groups[state.group]))
        try:
            return editor.duplicate(copies)
        except IprtError as error:
            self._say(str(error), bad=True)
            return []


def listed(names: Sequence[str]) -> str:
    """Return names in words: a few by name, many by number."""
    return ", ".join(names) if len(names) < 4 else f"{len(names)} objects"
