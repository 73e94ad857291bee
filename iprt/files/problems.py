"""Problems with a manifest in words: one line each, with the path of the key."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from itertools import islice
from typing import Any

from pydantic import BaseModel

from iprt.errors import SceneError
from iprt.files.toml_text import printable

FRAME_PATTERN = re.compile(r"%(0\d)?d")
"""The printf conversions of a frame's number: %d, %04d."""

PICTURE_SUFFIXES = (
    *(".exr", ".png", ".jpg", ".jpeg", ".webp", ".avif", ".heic", ".heif", ".tif", ".tiff"),
    *(".hdr", ".pfm", ".npy", ".npz"),
)

TABLE_LISTS = ("objects", "real_materials", "views")
"""Keys that hold lists of named tables."""

MAX_PROBLEMS = 100
"""Limit for the problems that an error lists."""
MAX_LETTERS = 1000
"""Limit for the length of a problem in an error."""


def problems_error(source: str, problems: Sequence[str]) -> SceneError:
    """Build one error for all problems, up to `MAX_PROBLEMS`, a line each."""
    shown = [printable(problem, MAX_LETTERS) for problem in problems[:MAX_PROBLEMS]]
    if len(problems) == 1:
        return SceneError(f"{source}: {shown[0]}")
    count = f"{len(problems)}" if len(problems) == len(shown) else f"more than {len(shown)}"
    lines = [f"{printable(source, MAX_LETTERS)}: {count} problems", *shown]
    return SceneError("\n  ".join(lines), several_lines=True)


def describe(
    problem: Mapping[str, Any], data: dict[str, Any], table: type[BaseModel] | None
) -> str:
    """Describe one pydantic error in a line: the key's path and the fault.

    Parameters
    ----------
    problem : mapping
        An entry of `ValidationError.errors()`.
    data : dict
        The manifest as read.
    table : pydantic model class or None
        The table with the keys that an unknown key may have meant.
    """
    kind, location, value = problem["type"], list(problem["loc"]), problem["input"]
    if "material" in location:
        # pydantic inserts the tag of the union's member, which is not a key of the file.
        del location[location.index("material") + 1 : location.index("material") + 2]
    if location[0] == "real_materials":
        del location[2:3]
    key = _key_path(location, data)
    if kind == "extra_forbidden":
        known = [] if table is None else list(table.model_fields)
        close = get_close_matches(str(location[-1])[:80], known, n=1)
        return f"{key}: unknown key" + (f"; did you mean {close[0]}?" if close else "")
    if kind == "missing":
        return f"{key}: required key is missing"
    if kind == "value_error":
        return f"{key}: {problem['msg'].removeprefix('Value error, ')}"
    if kind == "too_long" and location[-1] in TABLE_LISTS:
        hint = "; join their meshes" if key == "objects" else ""
        return f"{key}: {len(value)} of them; at most {problem['ctx']['max_length']} are read{hint}"
    if kind in ("too_short", "too_long"):
        count = problem["ctx"].get("min_length") or problem["ctx"].get("max_length")
        return f"{key}: expected {count} values, got {len(value)}"
    if kind == "model_type":
        return f"{key}: expected a table of keys, got {_shown(value)}"
    if kind == "list_type":
        hint = f"; write [[{key}]]" if key in TABLE_LISTS else ""
        return f"{key}: expected a list, got {_shown(value)}{hint}"
    message = problem["msg"].replace("Input should be", "expected")
    return f"{key}: {message}, got {_shown(value)}"


def cross_problems(data: dict[str, Any]) -> Iterator[str]:
    """Yield inconsistencies between keys: duplicate names, unknown objects, cuts, order of frames.

    It reads the unvalidated data, so that these appear together with all other problems. Entries of
    a wrong type are skipped.
    """
    lists = {key: _tables(data.get(key)) for key in TABLE_LISTS}
    for key, tables in lists.items():
        names = Counter(table["name"] for table in tables if isinstance(table.get("name"), str))
        for name, count in names.items():
            if count > 1:
                yield f"{key}: {count} of them are named '{name}'; names must differ"
    known = dict.fromkeys(str(table.get("name")) for table in lists["objects"])
    yield from _region_problems(lists["real_materials"])
    for number, view in enumerate(lists["views"]):
        label = f"views.{view.get('name', number)}"
        yield from _unknown_objects(label, view.get("objects"), known)
        yield from _cut_problems(label, view.get("cuts"), view.get("size"))
    yield from _video_problems(data.get("video"))


def _region_problems(real_materials: list[dict[str, Any]]) -> Iterator[str]:
    for number, table in enumerate(real_materials):
        label = f"real_materials.{table.get('name', number)}"
        if not {"mask", "color", "plane"} & table.keys():
            yield f"{label}: say where the surface is: give a mask, a color or a plane"
        if "color_tolerance" in table and "color" not in table:
            yield f"{label}.color_tolerance: has no effect without color; give color too"


def _unknown_objects(label: str, names: Any, known: Mapping[str, None]) -> Iterator[str]:
    for name in names if isinstance(names, list) else []:
        if isinstance(name, str) and name not in known:
            has = f"the scene has {', '.join(islice(known, 100)) or 'none'}"
            yield f"{label}.objects: no object is named '{name}'; {has}"


def _cut_problems(label: str, cuts: Any, size: Any) -> Iterator[str]:
    if not isinstance(cuts, list) or not _integers(size, 2):
        return
    width, height = size
    for number, cut in enumerate(cuts):
        if not _integers(cut, 4):
            continue
        x0, y0, x1, y1 = cut
        if not (x0 < x1 <= width and y0 < y1 <= height):
            yield (
                f"{label}.cuts[{number}]: {cut} is empty or outside the {width} x {height} picture"
            )


def _video_problems(video: Any) -> Iterator[str]:
    if not isinstance(video, dict):
        return
    if {"depth_scale", "depth_range"} <= video.keys():
        yield "video.depth_range: depth_scale is given too; give one of them"
    if "depth_encoding" in video and "depth_range" not in video:
        yield "video.depth_encoding: has no effect without depth_range; give depth_range too"
    invalid, sky = (video.get(f"depth_{key}") for key in ("invalid", "sky"))
    if isinstance(invalid, list) and isinstance(sky, list):
        for value in (value for value in sky if isinstance(value, float | int)):
            if value in invalid:
                yield f"video.depth_sky: {value:g} is in depth_invalid too; leave it out of one"
    color = video.get("color")
    if not isinstance(color, str):
        return
    pattern = FRAME_PATTERN.search(color)
    picture = pattern or color.lower().endswith(PICTURE_SUFFIXES)
    if picture and "depth" not in video:
        yield (
            "video.depth: required key is missing; name a file of depth (see docs/footage.md), or "
            "the file of color again if it is EXR and holds depth"
        )
    if not _integers(video.get("frames"), 2):
        return
    first, last = video["frames"]
    if first > last:
        yield f"video.frames: the first, {first}, is after the last, {last}"
    if first < last and picture and not pattern:
        yield (
            f"video.color: '{color}' is one picture but frames = [{first}, {last}]; "
            "write a pattern such as color.%04d.exr"
        )


def _key_path(location: Sequence[Any], data: dict[str, Any]) -> str:
    """Return the path of a key, such as `objects.bunny.material.alpha`, with names of entries."""
    parts: list[str] = []
    at: Any = data
    for step in location:
        if isinstance(step, int):
            at = at[step] if isinstance(at, list) and step < len(at) else None
            name = at.get("name") if isinstance(at, dict) else None
            if isinstance(name, str) and len(parts) == 1:
                parts.append(name)
            else:
                parts[-1] += f"[{step}]"
        else:
            at = at.get(step) if isinstance(at, dict) else None
            parts.append(str(step))
    return ".".join(parts)


def _tables(value: Any) -> list[dict[str, Any]]:
    entries = value if isinstance(value, list) else []
    return [entry for entry in entries if isinstance(entry, dict)]


def _integers(value: Any, count: int) -> bool:
    return (
        isinstance(value, list)
        and len(value) == count
        and all(isinstance(entry, int) for entry in value)
    )


def _shown(value: Any) -> str:
    text = repr(value[:40] if isinstance(value, str | list) else value)
    return text if len(text) <= 40 else text[:37] + "..."
