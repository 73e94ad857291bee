"""Writing of views and keyframes to a `scene.toml` document."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import tomlkit
from tomlkit.items import AoT, InlineTable, Table

from iprt.geometry.camera import View
from iprt.geometry.keyframes import Keyframe
from iprt.scene.manifest_writing import inline, table_text
from iprt.scene.view_edits import ViewEdit

DIGITS = 9
"""Decimals of quaternions in files."""


def new_view_texts(edits: Iterable[ViewEdit], known: Iterable[str]) -> list[str]:
    """Return the tables of the new views; `known` are the names of the objects in the file."""
    texts, names = [], list(known)
    for edit in edits:
        if not edit.new or edit.removed or edit.look is None:
            continue
        values: dict[str, Any] = _look(edit.look) | {"size": [edit.look.width, edit.look.height]}
        if edit.objects is not None:
            values["objects"] = [name for name in names if name in edit.objects]
        texts.append(table_text("views", name=edit.name, **values))
    return texts


def write_views(document: Any, edits: Iterable[ViewEdit]) -> None:
    """Change the views of a document, and mark the truths of views that look elsewhere."""
    by_name = {edit.name: edit for edit in edits}
    views = document.get("views", ())
    for number in reversed(range(len(views))):
        edit = by_name.get(str(views[number]["name"]))
        if edit is None:
            continue
        if edit.removed:
            del views[number]
        else:
            _write_view(views[number], edit)
    if "views" in document and not views:
        del document["views"]


def _write_view(table: Any, edit: ViewEdit) -> None:
    if edit.new_name is not None:
        table["name"] = edit.new_name
    if edit.look is not None and not edit.new:
        table.update(_look(edit.look))
    if edit.keyframes is not None:
        write_keyframes(table, edit.keyframes)
    if edit.looks_elsewhere and "truth" in table:
        table["truth_outdated"] = True


def _look(view: View) -> dict[str, float]:
    keys = ("yaw_deg", "pitch_deg", "fov_y_deg")
    return {key: round(getattr(view, key), 3) for key in keys}


def write_keyframes(table: Any, keyframes: Sequence[Keyframe]) -> None:
    """Replace the keyframes of an object or a view, and keep the comments of the others."""
    old = table.get("keyframes")
    if not keyframes:
        table.pop("keyframes", None)
        return
    if isinstance(table, InlineTable) or (old is not None and not isinstance(old, AoT)):
        table["keyframes"] = keyframe_array(keyframes)
        return
    tables: list[Table] = []
    parsed = [(entry, type(keyframes[0]).model_validate(entry.unwrap())) for entry in old or ()]
    for key in keyframes:
        at_time = [pair for pair in parsed if pair[1].time == key.time]
        equal = [p for p in parsed if p[1].model_copy(update={"time": key.time}) == key]
        pair = next(iter([*at_time, *equal]), None)
        if pair is None:
            entry = tomlkit.table()
            before = (tables or [table])[-1].as_string()
            entry.trivia.indent = "" if before.endswith("\n\n") else "\n"
            _update(entry, None, key)
            entry.add(tomlkit.nl())
        else:
            parsed.remove(pair)
            entry = pair[0]
            _update(entry, pair[1], key)
        tables.append(entry)
    table["keyframes"] = AoT(tables, "keyframes", parsed=True)  # adds no empty lines


def _update(entry: Any, before: Keyframe | None, key: Keyframe) -> None:
    """Write what differs between two keyframes, by default all, to a table."""
    old = {} if before is None else before.model_dump(exclude_defaults=True)
    new, written = key.model_dump(exclude_defaults=True), keyframe_values(key)
    for name in old.keys() - new.keys():
        entry.remove(name)
    for name, value in new.items():
        if old.get(name) != value:
            entry[name] = written[name]


def keyframe_array(keyframes: Sequence[Keyframe]) -> tomlkit.items.Array:
    """Return keyframes as an array of tables, a line each."""
    rows = tomlkit.array()
    for key in keyframes:
        rows.add_line(inline(keyframe_values(key)), indent="  ")
    rows.add_line(indent="")
    return rows


def keyframe_values(key: Keyframe) -> dict[str, Any]:
    """Return the keys and values of a keyframe in `scene.toml`."""
    values: dict[str, Any] = {}
    for name, value in key.model_dump(exclude_defaults=True).items():
        if name == "scale" and len(set(value)) == 1:
            value = value[0]
        if name == "rotation":
            value = [round(part, DIGITS) + 0.0 for part in value]
        values[name] = value
    return values
