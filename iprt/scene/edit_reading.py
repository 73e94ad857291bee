"""Reading of edits from two texts of `scene.toml`, without and with them.

The edits apply to the present scene, which other programs may have changed since. It
is the opposite of `iprt.scene.edit_writing`. An attribute of `ObjectEdit` that replaces a value of
an object is read once it is in `object_edits.VALUES`, and `_edited_value` converts it.
"""

from __future__ import annotations

import filecmp
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import accumulate
from pathlib import Path
from typing import Any

from iprt.errors import SceneError
from iprt.files.safe_reading import require_inside
from iprt.geometry.meshes import load_mesh
from iprt.scene.light_edits import PARTS, LightEdit
from iprt.scene.manifest import MANIFEST_NAME, Manifest, ObjectTable
from iprt.scene.manifest_writing import free_name
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

    A new object whose name is taken gets another one.

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
    found = [TableEdit(name) for name in old if name not in new and name in known]
    originals = _Originals(old, new)
    for name, table in new.items():
        base, mine = old.get(name), known.get(name)
        if table == base:
            continue
        if base is None and (mine is None or not _alike(root, table, mine)):
            base = originals.of(table)
            if mine is not None:
                name = free_name(name, known.keys() | new.keys())
            if base is None:
                given = tuple(part for part in VALUES if getattr(table, part))
                found.append(TableEdit(name, table, None, given))
                continue
            mine = known.get(base.name)
        if mine is None:
            raise SceneError(
                f"{name}: {MANIFEST_NAME} no longer has the object that was edited; put it back"
            )
        parts = tuple(_changed(table, mine, base))
        if parts or mine.name != name:
            found.append(TableEdit(name, table, mine, parts))
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
    if part == "keyframes":
        return tuple(table.keyframes)
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


class _Originals:
    """The objects that new ones are copies of, as edits that write the same text have it.

    Renamed objects are copies of removed ones at the same place. Other new ones come last.
    """

    def __init__(self, old: Tables, new: Tables) -> None:
        self._old, self._places = old, _places(new, old)
        places = _places(old, new).items()
        self._removed = {name: place for name, place in places if name not in new}

    def of(self, table: ObjectTable) -> ObjectTable | None:
        """Return the original of the next new object, rather a removed one; None without one."""
        place, removed = self._places[table.name], self._removed
        candidates = [
            other
            for other in self._old.values()
            if removed.get(other.name, place) == place and _copies(table, other)
        ]
        renamed = next((other for other in candidates if other.name in removed), None)
        for name in list(removed):
            if renamed is not None and name == renamed.name:
                del removed[name]
                break
            removed[name] = -1  # a later object renames none of those before
        return renamed or max(candidates, key=partial(_likeness, table), default=None)


def _places(tables: Tables, others: Tables) -> dict[str, int]:
    """Return how many objects come before each that the others have, too."""
    shared = accumulate((name in others for name in tables), initial=0)
    return dict(zip(tables, shared, strict=False))


def _likeness(one: ObjectTable, other: ObjectTable) -> int:
    return sum(getattr(one, part) == getattr(other, part) for part in VALUES)


def _copies(table: ObjectTable, other: ObjectTable) -> bool:
    """Return True if edits make the one object from the other."""
    if table.material is None and other.material is not None:
        return False
    profiles = (getattr(one.light, "profile", None) for one in (table, other))
    same = all(getattr(table, k) == getattr(other, k) for k in ("mesh", "animation"))
    return same and len(set(profiles)) == 1
