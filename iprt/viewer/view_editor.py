"""Edits of a scene's views, which all clients share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from iprt.geometry.camera import View
from iprt.scene.manifest_writing import free_name
from iprt.scene.scene_view import SceneView
from iprt.viewer.keyframing import rounded
from iprt.viewer.shared_state import SharedState


class ViewEditor:
    """Editor of a scene's views; each call is one step of undo, and thread-safe.

    Parameters
    ----------
    shared : SharedState
    views : callable
        Returns the views with all edits, by name.
    """

    def __init__(self, shared: SharedState, views: Callable[[], Mapping[str, SceneView]]) -> None:
        self._shared, self._views = shared, views

    def add(self, wanted: str, look: View, objects: tuple[str, ...] | None) -> str:
        """Add a view of the wanted name, or of a free one like it; return its name."""
        name = self._free_name(wanted)
        self._edit(name, look=rounded(look), objects=objects, new=True)
        return name

    def look(self, name: str, look: View) -> None:
        """Change the direction and field of view that a view has without keyframes."""
        self._edit(name, look=rounded(look))

    def rename(self, name: str, wanted: str) -> str:
        """Rename a view to the wanted name, or to a free one like it; return its name."""
        if wanted == name:
            return name
        new = self._free_name(wanted)
        self._edit(name, new_name=new)
        return new

    def remove(self, name: str) -> None:
        """Remove a view."""
        self._edit(name, removed=True)

    def _edit(self, name: str, **parts: Any) -> None:
        self._shared.edit(lambda world: world.view_edited(name, **parts))

    def _free_name(self, wanted: str) -> str:
        edits = self._shared.world.views
        taken = {name for edit in edits for name in (edit.name, edit.shown_name)}
        return free_name(wanted, taken | set(self._views()))
