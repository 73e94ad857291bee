"""Reading of edits from two texts of `scene.toml`, without and with them.

The edits become those of the scene as it is now, which other programs may have changed since. It
is the opposite of `iprt.scene.edit_writing`. An attribute of `ObjectEdit` that replaces a value of
an object is read once it is in `object_edits.VALUES`, and `_edited_value` converts it.
"""

from __future__ import annotations

import filecmp
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

from iprt.errors import SceneError
from iprt.files.safe_reading import require_inside
from iprt.geometry.meshes import load_mesh
from iprt.scene.light_edits import PARTS, LightEdit
from iprt.scene.manifest import MANIFEST_NAME, Manifest, ObjectTable
from iprt.scene.object_edits import VALUES, ObjectEdit
from iprt.scene.objects import own_material
from iprt.scene.scene import Scene

Tables = Mapping[str, ObjectTable]


@dataclass(frozen=True)
class TableEdit:
    """An edit of an object, as tables of `scene.toml`.

    Attributes
    ----------
    name : str
    table : ObjectTable or None
        The edited table; None if the object is removed.
    original : ObjectTable or None
        The table before, or the one that a new object is a copy of; None for any other new object.
    parts : tuple of str
        The edited values, of `VALUES`.
    """

    name: str
    table: ObjectTable | None = None
    original: ObjectTable | None = None
    parts: tuple[str, ...] = ()

    @property
    def copy_of(self) -> str | None:
        """Name of the object that a new one is a copy of."""
        original = self.original
        return None if original is None or original.name == self.name else original.name


def table_edits(
    root: Path, before: Manifest, after: Manifest, now: Manifest
) -> tuple[TableEdit, ...]:
    """Return the edits of objects that `now` does not have yet.

    Parameters
    ----------
    root : Path
        The scene's folder.
    before, after, now : Manifest
        The scene before and after the edits, and as it is now.

    Raises
    ------
    SceneError
        The scene no longer has an edited object.
    """
    old, new, known = ({t.name: t for t in m.objects} for m in (before, after, now))
    removed = [name for name in old if name not in new]
    found = [TableEdit(name) for name in removed if name in known]
    places = _places(new, old)
    renamed = {name: place for name, place in _places(old, new).items() if name in removed}
    for name, table in new.items():
        base = old.get(name)
        if table == base:
            continue
        if base is None and (name not in known or not _alike(root, table, known[name])):
            base = _original(table, old, renamed, places[name])
            if base is None:
                given = tuple(part for part in VALUES if getattr(table, part))
                found.append(TableEdit(name, table, None, given))
                continue
            renamed.pop(base.name, None)
        original = known.get(name if base is None else base.name)
        if original is None:
            raise SceneError(
                f"{name}: {MANIFEST_NAME} no longer has the object that was edited; put it back"
            )
        parts = tuple(_changed(table, original, base))
        if parts or original.name != name:
            found.append(TableEdit(name, table, original, parts))
    return tuple(found)


def light_edit(before: Manifest, after: Manifest, now: Manifest) -> LightEdit:
    """Return the edits of light that `now` does not have yet; see `table_edits`."""
    videos = before.video, after.video, now.video
    values = ((part, *(getattr(video, part) for video in videos)) for part in PARTS)
    return LightEdit(**{part: new for part, old, new, has in values if new not in (old, has)})


def object_edits(scene: Scene, edits: Iterable[TableEdit]) -> tuple[ObjectEdit, ...]:
    """Return edits of a scene's objects, with the meshes and maps that they name.

    Raises
    ------
    FormatError
        A file cannot be read, or lies outside the scene's folder.
    """
    load = cache(lambda path: load_mesh(path, None, scene.within))
    found = []
    for edit in edits:
        table, values = edit.table, dict[str, Any]()
        if table is None:
            found.append(ObjectEdit(edit.name, removed=True))
            continue
        if edit.original is None and table.mesh is not None:
            path = scene.root / table.mesh
            require_inside(path, scene.within)
            values = {"path": path, "mesh": load(path)}
        values |= {part: _edited_value(scene, table, part) for part in edit.parts}
        found.append(ObjectEdit(edit.name, copy_of=edit.copy_of, **values))
    return tuple(found)


def _edited_value(scene: Scene, table: ObjectTable, part: str) -> Any:
    """Return a value of a table as `ObjectEdit` has it."""
    if part == "to_world":
        return tuple(table.to_world)
    if part == "group":
        return table.group or ""
    if part == "material" and table.material is not None:
        for name in table.material.maps.values():
            require_inside(scene.root / name, scene.within)
        return own_material(scene.root, table)
    return getattr(table, part)


def _changed(table: ObjectTable, original: ObjectTable, base: ObjectTable | None) -> Iterator[str]:
    """Yield the values that differ from the scene's, and from those before the edits."""
    for part in VALUES:
        value = getattr(table, part)
        if value != getattr(original, part) and (base is None or value != getattr(base, part)):
            yield part


def _alike(root: Path, one: ObjectTable, other: ObjectTable) -> bool:
    """Return True if two objects have the same mesh, or are lights."""
    if one.mesh is None or other.mesh is None:
        return one.mesh == other.mesh
    try:
        return filecmp.cmp(root / one.mesh, root / other.mesh, shallow=False)
    except OSError:
        return False


def _places(tables: Tables, others: Tables) -> dict[str, int]:
    """Return how many objects come before each that the others have, too."""
    shared = accumulate((name in others for name in tables), initial=0)
    return dict(zip(tables, shared, strict=False))


def _original(
    table: ObjectTable, old: Tables, removed: Mapping[str, int], place: int
) -> ObjectTable | None:
    """Return the object that a new one is a copy of.

    That is rather a removed one, which it renames, if both are at the same place.
    """
    candidates = [
        other
        for other in old.values()
        if removed.get(other.name, place) == place and _copies(table, other)
    ]

    def likeness(other: ObjectTable) -> tuple[bool, int]:
        same = sum(getattr(table, part) == getattr(other, part) for part in VALUES)
        return other.name in removed, same

    return max(candidates, key=likeness, default=None)


def _copies(table: ObjectTable, other: ObjectTable) -> bool:
    """Return True if edits make the one object from the other."""
    if table.material is None and other.material is not None:
        return False
    profiles = (getattr(one.light, "profile", None) for one in (table, other))
    same = all(getattr(table, k) == getattr(other, k) for k in ("mesh", "animation", "keyframes"))
    return same and len(set(profiles)) == 1
