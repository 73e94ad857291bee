"""Sliders of settings, derived from their model; reading and writing of values; presets."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from iprt.files.message_text import printable
from iprt.settings.methods import DEFAULT
from iprt.settings.model import Settings
from iprt.settings.overrides import (
    Assignment,
    Schema,
    assigned,
    changed,
    plain_values,
)
from iprt.settings.presets import PRESETS, Quality

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


def slider_of(schema: Schema, default: float) -> Slider:
    """Derive the slider of a number from its JSON schema.

    The ends are the model's bounds, limited to `REACH` times the default. They stay away from an
    exclusive bound by a hundredth of the default's distance from it.
    """
    whole = schema["type"] == "integer"
    lower = schema.get("minimum", schema.get("exclusiveMinimum", -math.inf))
    upper = schema.get("maximum", schema.get("exclusiveMaximum", math.inf))
    reach = REACH * max(abs(default), 1 if whole else 0) or REACH
    low = max(lower, min(-reach, default))
    high = min(upper, max(reach, default))
    if low == schema.get("exclusiveMinimum"):
        low += 1 if whole else (default - low) / REACH
    if high == schema.get("exclusiveMaximum"):
        high -= 1 if whole else (high - default) / REACH
    spans_decades = low >= 0.0 and 0.0 < DECADE * default < high
    bend = (low if low > 0.0 else default / DECADE) if spans_decades else 0.0
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


def compared_presets(settings: Settings) -> dict[str, dict[str, str]]:
    """Return the values of settings in all presets and in `settings`, for a table.

    Returns
    -------
    dict of str to dict of str to str
        Rows by the settings' keys, each with the presets' values and then, under "now", the
        current one. Settings that are the same everywhere have none.
    """
    columns: dict[str, Mapping[str, Any]] = {
        name: plain_values(with_preset(Settings(method=settings.method), name)) for name in PRESETS
    }
    columns["now"] = plain_values(settings)
    rows = {key: {name: column[key] for name, column in columns.items()} for key in columns["now"]}
    return {
        key: {name: _word(value) for name, value in row.items()}
        for key, row in rows.items()
        if any(value != row["now"] for value in row.values())
    }


def _word(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, default=str)
