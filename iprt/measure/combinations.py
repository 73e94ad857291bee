"""Combinations of settings to compare: sweeps over values, and settings of still pictures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from iprt.errors import IprtError
from iprt.settings.methods import methods
from iprt.settings.model import Settings
from iprt.settings.overrides import Assignment, changed, parse_assignment, resolved
from iprt.settings.presets import STILL, Quality

QUALITY = "quality"
"""Key of the preset in sweeps. All other keys are settings."""
MAX_COMBINATIONS = 1000


@dataclass(frozen=True)
class Combination:
    """Settings to measure, and their swept values by key."""

    values: Mapping[str, Any]
    settings: Settings

    @property
    def label(self) -> str:
        """Label such as `trace.rays=4, mask.sparse=false`; `base` without swept values."""
        return ", ".join(f"{k}={value_text(v)}" for k, v in self.values.items()) or "base"


def combinations(
    quality: Quality,
    given: Sequence[Assignment],
    sweeps: Sequence[str],
    *,
    one_at_a_time: bool = False,
    still: bool = True,
) -> list[Combination]:
    """Expand sweeps such as `trace.rays=1,2,4` into combinations and validate them.

    Parameters
    ----------
    quality : str
        Preset of all combinations, unless swept.
    given : sequence of Assignment
        Assignments common to all combinations.
    sweeps : sequence of str
        Sweeps, `KEY=VALUE,VALUE,...`.
    one_at_a_time : bool
        Start with a combination without changes and change one setting at a time. Else form the
        Cartesian product.
    still : bool
        The combinations are for still pictures.

    Raises
    ------
    IprtError
        A value is not allowed, a setting is swept twice, or there are too many combinations.
    """
    axes = [_axis(text, still=still) for text in sweeps]
    keys = [axis[0].key for axis in axes]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:
        raise IprtError(f"sweep {twice}: is swept twice; give all its values at once")
    count = sum(map(len, axes)) + 1 if one_at_a_time else math.prod(map(len, axes))
    if count > MAX_COMBINATIONS:
        raise IprtError(f"sweep: {count} combinations; at most {MAX_COMBINATIONS} are run")
    if not one_at_a_time:
        return [_combination(quality, given, items) for items in itertools.product(*axes)]
    found = [_combination(quality, given, ())]
    for item in itertools.chain(*axes):
        candidate = _combination(quality, given, (item,))
        if candidate.settings != found[0].settings:
            found.append(candidate)
    return found


def _axis(text: str, *, still: bool) -> list[Assignment]:
    """Parse the assignments of a sweep."""
    key, equals, values = (part.strip() for part in text.partition("="))
    if not equals or not key or not values:
        raise IprtError(f"sweep {text}: expected KEY=VALUE,VALUE,..., such as trace.rays=1,2,4")
    words = [word.strip() for word in values.split(",")]
    if still and key in STILL:
        raise IprtError(
            f"sweep {text}: has no effect on a still picture, which averages all its frames"
        )
    if key == "method" and words == ["all"]:
        words = list(methods())
    if key != QUALITY:
        return [parse_assignment("sweep", f"{key}={word}") for word in words]
    for word in words:
        if word not in get_args(Quality):
            known = ", ".join(get_args(Quality))
            raise IprtError(f"sweep {QUALITY}={word}: expected some of {known}")
    return [Assignment(QUALITY, word, f"sweep {QUALITY}={word}") for word in words]


def _combination(
    quality: Quality, given: Sequence[Assignment], items: Sequence[Assignment]
) -> Combination:
    preset = next((item.value for item in items if item.key == QUALITY), quality)
    swept = [item for item in items if item.key != QUALITY]
    settings = resolved(preset, [*given, *swept])
    return Combination({item.key: item.value for item in items}, settings)


def value_text(value: object) -> str:
    """Format a swept value as on the command line."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def still_settings(settings: Settings, seed: int) -> Settings:
    """Return the settings for a still picture, with `seed` added to the settings' own seed."""
    return changed(settings, {**STILL, "seed": (settings.seed + seed) % 2**31})
