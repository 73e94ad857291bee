"""Edits of a scene's views, which `iprt.scene.view_writing` writes to `scene.toml`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from iprt.geometry.camera import View
from iprt.geometry.keyframes import ViewKeyframe, ViewMotion
from iprt.scene.scene_view import SceneView


@dataclass(frozen=True)
class ViewEdit:
    """A view's differences from the scene's files.

    Attributes
    ----------
    name : str
        Name in the files, or of a new view.
    new_name : str or None
        Replaces the name.
    look : View or None
        Replaces direction and field of view without keyframes; of a new view, the size too.
    keyframes : tuple of ViewKeyframe or None
        Replaces the view's own.
    objects : tuple of str or None
        Names of the objects that a new view shows; None for all.
    new : bool
        The files do not have the view.
    removed : bool
        The view is removed.
    """

    name: str
    new_name: str | None = None
    look: View | None = None
    keyframes: tuple[ViewKeyframe, ...] | None = field(default=None, hash=False)  # not hashable
    objects: tuple[str, ...] | None = None
    new: bool = False
    removed: bool = False

    @property
    def shown_name(self) -> str:
        """The name with the edit."""
        return self.name if self.new_name is None else self.new_name

    @property
    def looks_elsewhere(self) -> bool:
        """True if pictures of the view change."""
        return self.look is not None or self.keyframes is not None


def views_besides(edits: Iterable[ViewEdit], saved: Iterable[ViewEdit]) -> tuple[ViewEdit, ...]:
    """Return what edits change besides saved ones, for files that contain those."""
    by_name = {edit.name: edit for edit in saved}
    found = []
    for edit in edits:
        before = by_name.get(edit.name)
        if before is None:
            found.append(edit)
        elif edit != before:
            parts = ("new_name", "look", "keyframes")
            same: dict[str, Any] = {
                part: None for part in parts if getattr(edit, part) == getattr(before, part)
            }
            name = before.shown_name
            found.append(replace(edit, name=name, new=False, objects=None, **same))
    return tuple(found)


def edited_views(
    views: Mapping[str, SceneView], edits: Iterable[ViewEdit], all_objects: tuple[str, ...]
) -> dict[str, SceneView]:
    """Return the views with all edits applied; new views come last.

    `all_objects` are shown by new views that do not name any.
    """
    by_name = {edit.name: edit for edit in edits}
    found = [_edited(entry, by_name.get(name)) for name, entry in views.items()]
    for edit in by_name.values():
        if edit.new and edit.look is not None and edit.name not in views:
            objects = all_objects if edit.objects is None else edit.objects
            entry = SceneView(edit.name, edit.look, objects, None, None, None, ())
            found.append(_edited(entry, edit))
    return {entry.name: entry for entry in found if entry is not None}


def _edited(entry: SceneView, edit: ViewEdit | None) -> SceneView | None:
    if edit is None:
        return entry
    if edit.removed:
        return None
    motion = entry.motion
    base = entry.view if motion is None else motion.view
    keyframes = () if motion is None else motion.keyframes
    if edit.look is not None:
        base = edit.look.resized(base.width, base.height)
    if edit.keyframes is not None:
        keyframes = edit.keyframes
    motion = ViewMotion.of(base, keyframes) if keyframes else None
    view = base if motion is None else motion.at(0.0)
    return replace(entry, name=edit.shown_name, view=view, motion=motion)
