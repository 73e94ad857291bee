"""Settings by dotted name, as files and flags set them.

All names, bounds and texts come from the model, so that a new field needs no further code.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import tomlkit
from pydantic import BaseModel, ValidationError

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.files.toml_text import parse_toml, read_text
from iprt.settings.methods import DEFAULT, methods
from iprt.settings.model import Settings
from iprt.settings.presets import PRESETS, Quality

Schema = Mapping[str, Any]
Model = TypeVar("Model", bound=BaseModel)
WIDTH = 96
"""Line width of the comments in a settings file."""


@dataclass(frozen=True)
class Setting:
    """A setting of the renderer.

    Attributes
    ----------
    key : str
        Dotted name, `trace.rays`.
    group : str
        Name of its group, `trace`; empty at the top level.
    default : object
        Default as plain data.
    help : str
        Meaning and effect.
    allowed : str
        Type, bounds and unit in words.
    schema : mapping
        JSON schema of its values.
    """

    key: str
    group: str
    default: Any
    help: str
    allowed: str
    schema: Schema


@dataclass(frozen=True)
class Assignment:
    """A value for a setting from a file or flag; `source` names its origin in errors."""

    key: str
    value: Any
    source: str


@cache
def all_settings() -> dict[str, Setting]:
    """Return all settings by key, in the order of the model, top level before groups."""
    return {setting.key: setting for setting, _ in _walk()}


@cache
def groups() -> dict[str, str]:
    """Return the description of each group of settings, by name."""
    return {setting.group: about for setting, about in _walk() if setting.group}


def resolved(quality: Quality, assignments: Iterable[Assignment] = ()) -> Settings:
    """Return the settings of a preset with `assignments`; later ones win.

    Raises
    ------
    IprtError
        A key is not a setting, or a value has the wrong type or is out of bounds.
    """
    asked = [*preset_settings(quality), *assignments]
    names = [item.value for item in asked if item.key == "method"]
    known = bool(names) and names[-1] in methods()  # `assigned` reports unknown ones
    return assigned(Settings(method=names[-1]) if known else Settings(), asked)


def preset_settings(quality: Quality) -> list[Assignment]:
    """Return the assignments of a preset."""
    return [Assignment(k, v, f"preset {quality}: {k}") for k, v in PRESETS[quality].items()]


def assigned(settings: Settings, assignments: Iterable[Assignment]) -> Settings:
    """Return the settings with `assignments`; later ones win.

    Raises
    ------
    IprtError
        As `resolved`.
    """
    # All values are needed: a group's default may differ from its fields' defaults.
    values = plain_values(settings)
    sources: dict[str, str] = {}
    for item in assignments:
        _require_setting(item)
        values[item.key], sources[item.key] = item.value, item.source
    tables = _nested(values)
    own = tuple(
        _validated(info.settings, tables.pop(name), sources, name)
        for name, info in methods().items()
        if info.settings is not None
    )
    return _validated(Settings, tables, sources).model_copy(update={"of_methods": own})


def _validated(
    kind: type[Model], table: Mapping[str, Any], sources: Mapping[str, str], group: str = ""
) -> Model:
    """Validate plain data as a model; `sources` as in `_complaint`."""
    try:
        # Strict JSON validation turns lists into tuples, but no text into a number and no 2.5 into
        # an integer.
        return kind.model_validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as error:
        raise IprtError(_complaint(error, sources, group)) from None


def changed(settings: Settings, values: Mapping[str, Any]) -> Settings:
    """Return the settings with other valid values, by key.

    If the method changes, settings at the old method's default get the new method's default.
    """
    now = plain_values(settings)
    if "method" in values:
        before = plain_values(Settings(method=settings.method))
        default = plain_values(Settings(method=values["method"]))
        now = {key: default[key] if now[key] == before[key] else now[key] for key in now}
    given = {**now, **values}
    return assigned(settings, [Assignment(key, value, key) for key, value in given.items()])


def plain_values(settings: Settings) -> dict[str, Any]:
    """Return the value of every setting, as plain data."""
    return dict(_flat(settings.model_dump(mode="json")))


def read_settings(path: Path) -> list[Assignment]:
    """Read the assignments of a TOML file, as `iprt settings` prints it.

    Raises
    ------
    IprtError
        The file is unreadable or no TOML, or has an unknown key.
    """
    try:
        tables = parse_toml(read_text(path))
    except OSError as error:
        raise IprtError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise IprtError(f"{path}: {error}") from None
    return table_settings(tables, str(path))


def table_settings(tables: Mapping[str, Any], source: str) -> list[Assignment]:
    """Return the assignments of parsed TOML; `source` names it in errors.

    Raises
    ------
    IprtError
        A key is no setting.
    """
    assignments = []
    for key, value in _flat(tables):
        shown = "{...}" if isinstance(value, dict) else printable(_toml_value(value), 100)
        assignments.append(Assignment(key, value, f"{source}: {printable(key)} = {shown}"))
    for item in assignments:
        _require_setting(item)
    return assignments


def parse_assignment(flag: str, text: str) -> Assignment:
    """Parse `KEY=VALUE` as given to `flag`; the value is TOML, but words need no quotes.

    Raises
    ------
    IprtError
        There is no `=`, or the key is not a setting.
    """
    text = " ".join(text.split())
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not key or not value:
        raise IprtError(f"{flag} {text}: expected KEY=VALUE, such as trace.rays=4")
    item = Assignment(key, plain_value(value), f"{flag} {text}")
    _require_setting(item)
    return item


def plain_value(text: str) -> Any:
    """Parse a TOML value, or return the text itself."""
    try:
        return parse_toml(f"x = {text}")["x"]
    except ValueError:
        return text


def settings_toml(settings: Settings, title: str) -> str:
    """Return a settings file that sets every value which differs from its method's default.

    The other settings are commented out, so that a preset can still choose them.
    """
    values = plain_values(settings)
    defaults = plain_values(Settings(method=settings.method)) | {"method": DEFAULT}
    lines, group = [f"# {title}", ""], ""
    for setting in all_settings().values():
        if setting.group != group:
            group = setting.group
            lines += [f"[{group}]", *_comment(groups()[group]), ""]
        usual = defaults[setting.key]
        default = "" if usual is None else f"; default {_toml_value(usual)}"
        name = setting.key.rpartition(".")[2]
        value = values[setting.key]
        # TOML has no null.
        line = f"{name} =" if value is None else f"{name} = {_toml_value(value)}"
        left_out = "#" if value == usual else ""
        lines += [
            *_comment(setting.help),
            *_comment(setting.allowed + default),
            left_out + line,
            "",
        ]
    return "\n".join(lines)


def _require_setting(item: Assignment) -> None:
    if item.key in all_settings():
        return
    if item.key in groups():
        members = _members(item.key)
        raise IprtError(f"{item.source}: '{item.key}' is a group; its settings are: {members}")
    near, group = _nearest(item.key), item.key.partition(".")[0]
    hint = "`iprt settings` lists all settings"
    if near is not None:
        hint = f"did you mean {near}?"
    elif group in groups():
        hint = f"the settings of {group} are: {_members(group)}"
    raise IprtError(f"{item.source}: there is no setting '{printable(item.key)}'; {hint}")


def _members(group: str) -> str:
    return ", ".join(key for key, setting in all_settings().items() if setting.group == group)


def _nearest(key: str) -> str | None:
    """Return the setting that was probably meant, by a similar name in any group, or None."""
    name = key.rpartition(".")[2]
    by_name: dict[str, list[str]] = {}
    for known in all_settings():
        by_name.setdefault(known.rpartition(".")[2], []).append(known)
    similar = [name] if name in by_name else get_close_matches(name, by_name, n=1, cutoff=0.8)
    candidates = [known for match in similar for known in by_name[match]] or list(all_settings())
    close = get_close_matches(key, candidates, n=1, cutoff=0.0 if similar else 0.8)
    return close[0] if close else None


def _complaint(error: ValidationError, sources: Mapping[str, str], group: str) -> str:
    """Return the first fault in one line: the origin of the value, and the allowed values.

    Parameters
    ----------
    error : ValidationError
    sources : mapping of str to str
        Origin of each value in error messages, by key.
    group : str
        Group of the invalid values; empty if `error` names it.
    """
    fault = error.errors()[0]
    parts = [*([group] if group else []), *(str(part) for part in fault["loc"])]
    keys = [".".join(parts[:count]) for count in range(len(parts), 0, -1)]
    setting = next((all_settings()[key] for key in keys if key in all_settings()), None)
    if setting is not None:
        return f"{sources.get(setting.key, setting.key)}: expected {setting.allowed}"
    # Inconsistent settings: the message names the last one given.
    inside = [source for key, source in sources.items() if not keys or key.startswith(keys[-1])]
    reason = fault["msg"].removeprefix("Value error, ")
    return f"{inside[-1] if inside else 'settings'}: {reason}"


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    tables: dict[str, Any] = {}
    for key, value in values.items():
        *path, name = key.split(".")
        table = tables
        for part in path:
            table = table.setdefault(part, {})
        table[name] = value
    return tables


def _flat(tables: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted keys and values of nested tables; a table that is no group is a value."""
    for name, value in tables.items():
        key = prefix + name
        if isinstance(value, dict) and key in groups():
            yield from _flat(value, f"{key}.")
        else:
            yield key, value


@cache
def _walk() -> tuple[tuple[Setting, str], ...]:
    """Return every setting with its group's description."""
    schema = Settings.model_json_schema()
    del schema["properties"]["of_methods"]
    defaults = Settings().model_dump(mode="json")
    found = [*_walk_group(schema, schema.get("$defs", {}), defaults, "", "")]
    for name, info in methods().items():
        if info.settings is not None:
            own = info.settings.model_json_schema()
            about = own.get("description", "").partition("\n")[0]
            found += _walk_group(own, own.get("$defs", {}), defaults[name], name, about)
    return tuple(found)


def _walk_group(
    group: Schema, definitions: Schema, defaults: Mapping[str, Any], name: str, about: str
) -> Iterator[tuple[Setting, str]]:
    inner = []
    for field, given in group["properties"].items():
        key = f"{name}.{field}" if name else field
        reference = given.get("$ref", "").rpartition("/")[2]
        schema = {**definitions[reference], **given} if reference else given
        if "properties" in schema:
            summary = schema.get("description", "").partition("\n")[0]
            inner.append((schema, definitions, defaults[field], key, summary))
        else:
            help_text = schema.get("description", "")
            yield Setting(key, name, defaults[field], help_text, allowed(schema), schema), about
    for arguments in inner:
        yield from _walk_group(*arguments)


def allowed(schema: Schema) -> str:
    """Describe the type, bounds and unit of a JSON schema in words."""
    if "anyOf" in schema:
        return " or ".join(allowed(option) for option in schema["anyOf"])
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " or ".join(json.dumps(value) for value in schema["enum"])
    kind = schema.get("type")
    if kind == "array":
        items: Sequence[Schema] = schema.get("prefixItems", [])
        inside = ", ".join(allowed(item) for item in items) or allowed(schema.get("items", {}))
        return f"a list of [{inside}]"
    words = {"boolean": "true or false", "integer": "a whole number", "number": "a number"}
    if kind in ("integer", "number"):
        unit = f" {schema['unit']}" if "unit" in schema else ""
        return words[kind] + _bounds(schema) + unit
    return words.get(str(kind), "nothing" if kind == "null" else "a text")


def _bounds(schema: Schema) -> str:
    low, above = schema.get("minimum"), schema.get("exclusiveMinimum")
    high, below = schema.get("maximum"), schema.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f" from {_number(low)} to {_number(high)}"
    words = {"at least": low, "above": above, "at most": high, "below": below}
    parts = [f"{word} {_number(value)}" for word, value in words.items() if value is not None]
    return f" {' and '.join(parts)}" if parts else ""


def _number(value: float) -> str:
    return f"{value:.0f}" if float(value).is_integer() else f"{value:g}"


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ")


def _toml_value(value: Any) -> str:
    return str(tomlkit.item(value).as_string())
