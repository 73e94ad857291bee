"""Undo and redo of edits."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from typing import TypeVar

from iprt.scene.light_edits import LightEdit
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.view_edits import ViewEdit

Changed = frozenset[tuple[str, str]]

GESTURE_S = 0.5
"""Longest interval in seconds between changes of one gesture, which are undone together."""
MOST_STEPS = 256
PARTS = [part.name for part in fields(ObjectEdit) if part.init and part.compare]
VIEW_PARTS = [part.name for part in fields(ViewEdit)]
Edit = TypeVar("Edit", ObjectEdit, ViewEdit)


@dataclass(frozen=True)
class Edits:
    """All edits at one time."""

    objects: tuple[ObjectEdit, ...]
    light: LightEdit
    views: tuple[ViewEdit, ...] = ()


class History:
    """The past and undone states of the edits."""

    def __init__(self) -> None:
        self._past: list[Edits] = []
        self._future: list[Edits] = []
        self._last: tuple[Changed, float] | None = None

    def add(self, before: Edits, after: Edits, now_s: float) -> None:
        """Record a change of the edits at a time in seconds."""
        changed = _changed(before, after)
        last, self._last = self._last, (changed, now_s)
        if last is None or last[0] != changed or now_s - last[1] > GESTURE_S:
            self._past = [*self._past, before][-MOST_STEPS:]
        self._future = []

    def end_gesture(self) -> None:
        """Keep the next change apart from the last one."""
        self._last = None

    def undo(self, now: Edits) -> Edits:
        """Return the edits before the last change, or the current ones without a change."""
        return self._go(self._past, self._future, now)

    def redo(self, now: Edits) -> Edits:
        """Return the edits before the last `undo`, or the current ones without one."""
        return self._go(self._future, self._past, now)

    def _go(self, where: list[Edits], back: list[Edits], now: Edits) -> Edits:
        self._last = None
        if not where:
            return now
        back.append(now)
        return where.pop()

    @property
    def can_undo(self) -> bool:
        """True if there is a change to undo."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """True if there is a change to redo."""
        return bool(self._future)

    def clear(self) -> None:
        """Forget all states."""
        self._past, self._future, self._last = [], [], None


def _changed(before: Edits, after: Edits) -> Changed:
    """Return the changed parts of the edits, with the names of objects and views."""
    objects = _differing(before.objects, after.objects, ObjectEdit, PARTS)
    views = _differing(before.views, after.views, ViewEdit, VIEW_PARTS)
    light = (("", part) for part in before.light.differing(after.light))
    return frozenset([*objects, *views, *light])


def _differing(
    before: Iterable[Edit], after: Iterable[Edit], empty: Callable[[str], Edit], parts: list[str]
) -> list[tuple[str, str]]:
    """Return the parts that differ, each after the name of its object or view."""
    old, new = ({edit.name: edit for edit in edits} for edits in (before, after))
    found = []
    for name in old.keys() | new.keys():
        one, other = old.get(name) or empty(name), new.get(name) or empty(name)
        differing = (part for part in parts if getattr(one, part) != getattr(other, part))
        found += [(name, _keys(one, other) if p == "keyframes" else p) for p in differing]
    return found


def _keys(one: Edit, other: Edit) -> str:
    """Return the times of the keyframes that differ; a gesture changes the same ones."""
    before, after = (tuple(edit.keyframes or ()) for edit in (one, other))
    differing = [key.time for key in before if key not in after]
    differing += [key.time for key in after if key not in before]
    return f"keyframes {sorted(set(differing))}"
