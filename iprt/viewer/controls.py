"""Every setting as a control of an interface, made from its model: sliders, switches, choices.

Nothing here draws. Both viewers walk `control_groups()`, show each control at
`value_of(settings, key)` and go on with `with_value(settings, key, value)`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from iprt.files.toml_text import printable
from iprt.settings.methods import DEFAULT
from iprt.settings.model import Settings
from iprt.settings.overrides import (
    Assignment,
    Schema,
    Setting,
    all_settings,
    assigned,
    changed,
    groups,
    plain_values,
)
from iprt.settings.presets import PRESETS, Quality

Kind = Literal["switch", "choice", "integer", "number", "numbers"]

REACH = 100.0
"""Sliders end at so many times the default, where the model allows more than that."""
DECADE = 10.0
"""Sliders are logarithmic whose upper end is more than so many times the default."""
DIGITS = 4
"""Significant ones of a number from a slider."""


@dataclass(frozen=True)
class Slider:
    """A range of numbers, from one end of a slider to the other.

    Attributes
    ----------
    low, high : float
        Both are allowed values. A setting may allow others beyond: a box for text takes them.
    whole : bool
        Numbers are whole ones.
    bend : float
        0: linear. Above: logarithmic, but linear among values of `low` to about `low + bend`; of a
        range that begins with `bend`, each part of the slider multiplies by the same factor.
    """

    low: float
    high: float
    whole: bool
    bend: float

    @property
    def logarithmic(self) -> bool:
        return self.bend > 0.0

    def value(self, position: float) -> float:
        """The number at a position from 0 to 1: an int where numbers are whole."""
        span, t = self.high - self.low, min(max(position, 0.0), 1.0)
        offset = t * span
        if self.logarithmic:
            offset = self.bend * math.expm1(t * math.log1p(span / self.bend))
        exact = self.low + offset
        rounded = round(exact) if self.whole else float(f"{exact:.{DIGITS}g}")
        if t in (0.0, 1.0):
            return self.high if t else self.low
        return min(max(rounded, self.low), self.high)


@dataclass(frozen=True)
class Control:
    """A setting, as an interface shows it.

    Attributes
    ----------
    key : str
        Key of the setting, `trace.object_rays`.
    label : str
        `object rays`.
    kind : {"switch", "choice", "integer", "number", "numbers"}
        Kind of its values: bool, str, int, float, or a list of numbers.
    choices : tuple of str
        What can be chosen, if it is a choice.
    sliders : tuple of Slider
        A number has one; a list, one for each of its numbers.
    nullable : bool
        It may have no value (None), too: an interface shows a switch besides.
    start : bool, str, int, float or list
        Its default; if that is None, what it begins with when it is given a value.
    unit : str
        Empty where there is none.
    help : str
        Meaning and consequence.
    allowed : str
        Type, bounds and unit in words.
    """

    key: str
    label: str
    kind: Kind
    choices: tuple[str, ...]
    sliders: tuple[Slider, ...]
    nullable: bool
    start: Any
    unit: str
    help: str
    allowed: str


@dataclass(frozen=True)
class ControlGroup:
    """The controls of a group of settings.

    Attributes
    ----------
    name : str
        `trace`; empty: those that are in no group.
    about : str
        In one sentence.
    controls : tuple of Control
        In the order of the model.
    """

    name: str
    about: str
    controls: tuple[Control, ...]


@cache
def control_groups() -> tuple[ControlGroup, ...]:
    """All settings, in the order of the model."""
    by_group: dict[str, list[Control]] = {}
    for setting in all_settings().values():
        by_group.setdefault(setting.group, []).append(control_of(setting))
    abouts = {"": "What concerns all passes.", **groups()}
    return tuple(ControlGroup(g, abouts[g], tuple(c)) for g, c in by_group.items())


@cache
def controls() -> Mapping[str, Control]:
    """All of them by key."""
    return {control.key: control for group in control_groups() for control in group.controls}


def control_of(setting: Setting) -> Control:
    """The control of a setting.

    Raises
    ------
    TypeError
        No control shows values of its type.
    """
    options = setting.schema.get("anyOf", [setting.schema])
    schemas = [option for option in options if option.get("type") != "null"]
    if len(schemas) != 1:
        raise TypeError(f"{setting.key}: no control takes {setting.allowed}")
    schema = schemas[0]
    choices = tuple(schema.get("enum", ()))
    kind = "choice" if choices else _KINDS.get(str(schema.get("type")))
    sliders: tuple[Slider, ...] = ()
    if kind in ("integer", "number"):
        sliders = (slider_of(schema, setting.default),)
    elif kind == "numbers":
        items = schema.get("prefixItems", ())
        defaults = setting.default if setting.default is not None else [None] * len(items)
        sliders = tuple(map(slider_of, items, defaults))
    if kind is None or (kind == "numbers" and not sliders):
        raise TypeError(f"{setting.key}: no control takes {setting.allowed}")
    start = setting.default
    if start is None:
        middle = [slider.value(0.5) for slider in sliders]
        start = choices[0] if choices else middle if kind == "numbers" else (*middle, False)[0]
    return Control(
        key=setting.key,
        label=setting.key.rpartition(".")[2].replace("_", " "),
        kind=kind,
        choices=choices,
        sliders=sliders,
        nullable=len(options) > 1,
        start=start,
        unit=str(setting.schema.get("unit", schema.get("unit", ""))),
        help=setting.help,
        allowed=setting.allowed,
    )


_KINDS: Mapping[str, Kind] = {
    "boolean": "switch",
    "integer": "integer",
    "number": "number",
    "array": "numbers",
}


def slider_of(schema: Schema, default: float | None) -> Slider:
    """The slider of a number with this JSON schema.

    Ends are the model's bounds, but not beyond `REACH` times the default; they keep a hundredth of
    the default's distance from a bound that is itself not allowed.
    """
    whole = schema["type"] == "integer"
    lower = schema.get("minimum", schema.get("exclusiveMinimum", -math.inf))
    upper = schema.get("maximum", schema.get("exclusiveMaximum", math.inf))
    usual = default if default is not None else min(max(1, lower), upper)
    reach = REACH * max(abs(usual), 1 if whole else 0) or REACH
    low = max(lower, min(-reach, usual))
    high = min(upper, max(reach, usual))
    if low == schema.get("exclusiveMinimum"):
        low += 1 if whole else (usual - low) / REACH
    if high == schema.get("exclusiveMaximum"):
        high -= 1 if whole else (high - usual) / REACH
    spans_decades = low >= 0.0 and 0.0 < DECADE * usual < high
    bend = (low if low > 0.0 else usual / DECADE) if spans_decades else 0.0
    if whole:
        return Slider(math.ceil(low), math.floor(high), whole, bend)
    return Slider(float(low), float(high), whole, bend)


def value_of(settings: Settings, key: str) -> Any:
    """A setting's value, as plain data."""
    return plain_values(settings)[key]


def with_value(settings: Settings, key: str, value: Any) -> Settings:
    """The settings with another value of one setting; a method brings its defaults.

    Parameters
    ----------
    value : bool, int, float, str, list or None
        As plain data.

    Raises
    ------
    IprtError
        It is not allowed, or there is no such setting; in one line that says what is.
    """
    shown = printable(_word(value), 100)
    now = assigned(settings, [Assignment(key, value, f"{printable(key)} = {shown}")])
    return changed(settings, {key: value}) if key == "method" else now


@dataclass(frozen=True)
class Preset:
    """The preset that settings are, or the one from which the fewest settings differ.

    Attributes
    ----------
    quality : Quality
    differing : dict of str to (value, value)
        By key: what the preset has, and what the settings have. Empty: they are the preset.
    """

    quality: Quality
    differing: Mapping[str, tuple[Any, Any]]

    @property
    def text(self) -> str:
        """`draft`, or `draft, but trace.rays 1 -> 2`."""
        parts = [f"{key} {_word(a)} -> {_word(b)}" for key, (a, b) in self.differing.items()]
        return f"{self.quality}, but {', '.join(parts)}" if parts else self.quality


def preset_of(settings: Settings) -> Preset:
    """Which preset the settings are or are nearest to; of equally near ones, the default."""
    now, found = plain_values(settings), []
    for quality in PRESETS:
        preset = plain_values(with_preset(Settings(method=settings.method), quality))
        preset["method"] = DEFAULT
        differing = {key: (preset[key], now[key]) for key in now if preset[key] != now[key]}
        found.append(Preset(quality, differing))
    return min(found, key=lambda p: (len(p.differing), bool(PRESETS[p.quality])))


def with_preset(settings: Settings, quality: Quality) -> Settings:
    """The settings with all that presets set as this one has it, and everything else as it is.

    What this one leaves open gets the default of the settings' method.
    """
    defaults = plain_values(Settings(method=settings.method))
    shared = {key: defaults[key] for preset in PRESETS.values() for key in preset}
    return changed(settings, {**shared, **PRESETS[quality]})


def _word(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)
