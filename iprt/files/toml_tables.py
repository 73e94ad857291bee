"""Tables of TOML files: their base class, the types of their values, and errors in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from iprt.errors import SceneError
from iprt.files.kinds import FRAME_PATTERN
from iprt.files.message_text import printable
from iprt.files.safe_reading import MAX_SIDE, stays_inside

LAST_FRAME = 999_999
FARTHEST = 1e6
"""Largest number in a transform; beyond it, 32-bit floats cannot resolve centimetres."""


def _relative_path(text: str) -> str:
    """Validate a path that stays in the scene's folder."""
    if not stays_inside(text):
        raise ValueError(f"'{text}' leaves the scene's folder; copy the file into it")
    if not text or text.endswith("/") or text != printable(text, len(text)):
        raise ValueError(f"'{text}': expected the name of a file")
    return text


def _frame_path(text: str) -> str:
    """Validate a path that may hold the frame's number."""
    if "%" in FRAME_PATTERN.sub("", text, count=1):
        raise ValueError(f"'{text}': expected at most one %d or %04d and no other %")
    return _relative_path(text)


def _plain_name(text: str) -> str:
    if not text.strip() or set(text) & {"/", "\\"} or text != printable(text):
        raise ValueError(f"'{text}': expected a name without slashes")
    return text


def not_null(values: list[float]) -> list[float]:
    """Validate numbers that may not all be 0."""
    if not any(values):
        raise ValueError("expected at least one value that is not 0")
    return values


RelativePath = Annotated[str, AfterValidator(_relative_path)]
FramePath = Annotated[str, AfterValidator(_frame_path)]
Name = Annotated[str, AfterValidator(_plain_name)]
Unit = Annotated[float, Field(ge=0.0, le=1.0)]
Color = Annotated[list[Unit], Field(min_length=3, max_length=3)]
Ior = Annotated[float, Field(gt=1.0, le=4.0)]
Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
Pixel = Annotated[int, Field(ge=0, le=MAX_SIDE)]
FrameNumber = Annotated[int, Field(ge=0, le=LAST_FRAME)]
Factor = Annotated[float, Field(gt=0.0, le=1e12)]
Point = Annotated[
    list[Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]], Field(min_length=3, max_length=3)
]
Degrees = Annotated[float, Field(ge=-36000.0, le=36000.0)]
Pitch = Annotated[float, Field(ge=-90.0, le=90.0)]
FieldOfView = Annotated[float, Field(ge=0.01, lt=180.0)]


class Table(BaseModel):
    """A table without unknown keys, whose values have exactly the declared types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


TABLE_LISTS = ("objects", "real_materials", "views")
"""Keys that hold lists of named tables."""

KINDS = {
    "real_materials": "'plastic' or 'conductor'",
    "material": "'diffuse', 'conductor', 'plastic', 'principled' or 'dielectric'",
    "light": "'point', 'spot', 'rectangle' or 'sun'",
}
"""Values of `kind` of tables, in words."""
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
    for tagged in ("material", "light"):
        if tagged in location:
            # pydantic inserts the tag of the union's member, which is not a key of the file.
            del location[location.index(tagged) + 1 : location.index(tagged) + 2]
    if location[0] == "real_materials" or location[:2] == ["video", "sun"]:
        del location[2:3]
    key = _key_path(location, data)
    if kind in ("union_tag_invalid", "union_tag_not_found", "model_attributes_type"):
        kinds = KINDS["real_materials" if location[0] == "real_materials" else str(location[-1])]
        return f"{key}: expected kind = {kinds}"
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


def _shown(value: Any) -> str:
    text = repr(value[:40] if isinstance(value, str | list) else value)
    return text if len(text) <= 40 else text[:37] + "..."
