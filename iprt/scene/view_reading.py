"""Reading of edits of views from two manifests, without and with them."""

from __future__ import annotations

from collections.abc import Mapping

from iprt.scene.manifest import Manifest, ViewTable
from iprt.scene.view_edits import ViewEdit


def view_edits(before: Manifest, after: Manifest, now: Manifest) -> tuple[ViewEdit, ...]:
    """Return the edits of views that `now` does not have yet.

    Edits of views that `now` no longer has are left out. See `iprt.scene.edit_reading`.
    """
    old, new, known = ({t.name: t for t in m.views} for m in (before, after, now))
    names = _renamed(before, after)
    found = [
        ViewEdit(name, removed=True)
        for name in old
        if name not in new and name not in names.values() and name in known
    ]
    for name, table in new.items():
        base = old.get(names.get(name, name))
        if base is None:
            if name not in known:
                objects = None if table.objects is None else tuple(table.objects)
                keys = tuple(table.keyframes) or None
                found.append(ViewEdit(name, None, table.view, keys, objects, new=True))
            continue
        mine = known.get(base.name)
        edit = ViewEdit(
            base.name,
            new_name=None if name == base.name else name,
            look=None if table.view == base.view else table.view,
            keyframes=None if table.keyframes == base.keyframes else tuple(table.keyframes),
        )
        if mine is not None and edit != ViewEdit(base.name):
            found.append(edit)
    return tuple(found)


def _renamed(before: Manifest, after: Manifest) -> Mapping[str, str]:
    """Return the former names of renamed views: of those at the same place among the others."""
    old, new = ({t.name for t in m.views} for m in (before, after))
    gone = [table for table in before.views if table.name not in new]
    come = [table for table in after.views if table.name not in old]
    return {
        one.name: other.name
        for one, other in zip(come, gone, strict=False)
        if _place(after, one, old) == _place(before, other, new) and one.size == other.size
    }


def _place(manifest: Manifest, table: ViewTable, others: set[str]) -> int:
    """Return how many views come before one that the other manifest has, too."""
    views = manifest.views
    return sum(view.name in others for view in views[: views.index(table)])
