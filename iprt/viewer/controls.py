"""Controls for all settings, derived from their model: sliders, switches, choices.

This module does not draw. Both viewers walk `control_groups()`, show each control at
`value_of(settings, key)`, and apply changes by `with_value(settings, key, value)`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from iprt.files.message_text import printable
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
"""Sliders end at this multiple of the default if the model allows more."""
DECADE = 10.0
"""Sliders are logarithmic if their upper end is more than this multiple of the default."""
DIGITS = 4
"""Significant digits of a number from a slider."""


@dataclass(frozen=True)
class Slider:
    """The range of a slider.

    Attributes
    ----------
    low, high : float
        Allowed values at both ends. A text box also takes allowed values beyond them.
    whole : bool
        True for integers.
    bend : float
        0 for a linear slider. Otherwise the slider is logarithmic, but linear between `low` and
        about `low + bend`. In a range that begins with `bend`, equal steps multiply by the same
        factor.
    """

    low: float
    high: float
    whole: bool
    bend: float

    @property
    def logarithmic(self) -> bool:
        """True for a logarithmic slider."""
        return self.bend > 0.0

    def value(self, position: float) -> float:
        """Return the number at a position from 0 to 1; an int if `whole`."""
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
    """A setting as shown by an interface.

    Attributes
    ----------
    key : str
        Key of the setting, `trace.object_rays`.
    label : str
        Label, `object rays`.
    kind : {"switch", "choice", "integer", "number", "numbers"}
        Kind of its values: bool, str, int, float, or a list of numbers.
    choices : tuple of str
        Options of a choice.
    sliders : tuple of Slider
        One for a number, or one for each number of a list.
    nullable : bool
        True if the value may be None, for which interfaces show an additional switch.
    start : bool, str, int, float or list
        Default, or the initial value if the default is None.
    unit : str
        Unit; empty if there is none.
    help : str
        Meaning and effect.
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
        Name, `trace`; empty for settings outside groups.
    about : str
        Description in one sentence.
    controls : tuple of Control
        In the order of the model.
    """

    name: str
    about: str
    controls: tuple[Control, ...]


@cache
def control_groups() -> tuple[ControlGroup, ...]:
    """Return the controls of all settings, in the order of the model."""
    by_group: dict[str, list[Control]] = {}
    for setting in all_settings().values():
        by_group.setdefault(setting.group, []).append(control_of(setting))
    abouts = {"": "Settings of all passes.", **groups()}
    return tuple(ControlGroup(g, abouts[g], tuple(c)) for g, c in by_group.items())


@cache
def controls() -> Mapping[str, Control]:
    """Return all controls by key."""
    return {control.key: control for group in control_groups() for control in group.controls}


def control_of(setting: Setting) -> Control:
    """Derive the control of a setting.

    Raises
    ------
    TypeError
        No control supports its type.
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
    """Derive the slider of a number from its JSON schema.

    The ends are the model's bounds, limited to `REACH` times the default. They stay away from an
    exclusive bound by a hundredth of the default's distance from it.
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
    """Return a setting's value as plain data."""
    return plain_values(settings)[key]


def with_value(settings: Settings, key: str, value: Any) -> Settings:
    """Return the settings with another value of one setting; a method brings its defaults.

    Parameters
    ----------
    value : bool, int, float, str, list or None
        Plain data.

    Raises
    ------
    IprtError
        The value is not allowed or the setting is unknown; the message is one line.
    """
    shown = printable(_word(value), 100)
    now = assigned(settings, [Assignment(key, value, f"{printable(key)} = {shown}")])
    return changed(settings, {key: value}) if key == "method" else now


@dataclass(frozen=True)
class Preset:
    """The preset that settings equal or are closest to, with the differences.

    Attributes
    ----------
    quality : Quality
    differing : dict of str to (value, value)
        Values of the preset and of the settings by key; empty if they are equal.
    """

    quality: Quality
    differing: Mapping[str, tuple[Any, Any]]

    @property
    def text(self) -> str:
        """Description, such as `draft` or `draft, but trace.rays 1 -> 2`."""
        parts = [f"{key} {_word(a)} -> {_word(b)}" for key, (a, b) in self.differing.items()]
        return f"{self.quality}, but {', '.join(parts)}" if parts else self.quality


def preset_of(settings: Settings) -> Preset:
    """Return the preset with the fewest differences; among equals, the default."""
    now, found = plain_values(settings), []
    for quality in PRESETS:
        preset = plain_values(with_preset(Settings(method=settings.method), quality))
        preset["method"] = DEFAULT
        differing = {key: (preset[key], now[key]) for key in now if preset[key] != now[key]}
        found.append(Preset(quality, differing))
    return min(found, key=lambda p: (len(p.differing), bool(PRESETS[p.quality])))


def with_preset(settings: Settings, quality: Quality) -> Settings:
    """Return the settings with the values of a preset, and all other values unchanged.

    Settings that only other presets set get the default of the settings' method.
    """
    defaults = plain_values(Settings(method=settings.method))
    shared = {key: defaults[key] for preset in PRESETS.values() for key in preset}
    return changed(settings, {**shared, **PRESETS[quality]})


def _word(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)
