"""Undo and redo of edits."""

from __future__ import annotations

from iprt.scene.edits import ObjectEdit

Edits = tuple[ObjectEdit, ...]
Changed = frozenset[tuple[str, str]]

GESTURE_S = 0.5
"""Changes of the same kind to the same object that follow each other sooner are undone together."""
MOST_STEPS = 256


class History:
    """Edits that there were, and that were undone."""

    def __init__(self) -> None:
        self._past: list[Edits] = []
        self._future: list[Edits] = []
        self._last: tuple[Changed, float] | None = None

    def add(self, before: Edits, after: Edits, now_s: float) -> None:
        """One state of the edits follows another, at a time in seconds."""
        changed = _changed(before, after)
        last, self._last = self._last, (changed, now_s)
        if last is None or last[0] != changed or now_s - last[1] > GESTURE_S:
            self._past = [*self._past, before][-MOST_STEPS:]
        self._future = []

    def undo(self, now: Edits) -> Edits:
        """The edits before the last change; those of now if there was none."""
        return self._go(self._past, self._future, now)

    def redo(self, now: Edits) -> Edits:
        """The edits before the last `undo`; those of now if there was none since."""
        return self._go(self._future, self._past, now)

    def _go(self, where: list[Edits], back: list[Edits], now: Edits) -> Edits:
        self._last = None
        if not where:
            return now
        back.append(now)
        return where.pop()

    @property
    def can_undo(self) -> bool:
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        return bool(self._future)

    def clear(self) -> None:
        """Forget all: there is no way back."""
        self._past, self._future, self._last = [], [], None


def _changed(before: Edits, after: Edits) -> Changed:
    """Names of the objects, and what of their edits differs."""
    old, new = ({edit.name: edit for edit in edits} for edits in (before, after))
    return frozenset(
        (name, part)
        for name in old.keys() | new.keys()
        for part in ("to_world", "material", "path", "removed")
        if getattr(old.get(name, ObjectEdit(name)), part)
        != getattr(new.get(name, ObjectEdit(name)), part)
    )
