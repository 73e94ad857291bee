"""A ladder of settings from the quickest to the most accurate, of which each costs its gain.

What its entries cost and gain is measured: see `iprt.measure.tradeoff`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from iprt.settings.model import Settings
from iprt.settings.overrides import Assignment, plain_values
from iprt.settings.presets import PRESETS

BALANCED = "balanced"
"""The entry to which the times of all others are relative."""

_DRAFT = PRESETS["draft"]
LADDER: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        "light 8": {**_DRAFT, "light_scale": 8, "iprt.ratio_rows": 16, "atrous.levels": 2},
        "draft": _DRAFT,
        "light 2": {**_DRAFT, "light_scale": 2, "atrous.levels": 4},
        "light 2, rays 2": {
            "light_scale": 2,
            "trace.rays": 2,
            "trace.object_rays": 16,
            "atrous.levels": 4,
        },
        "balanced": PRESETS["balanced"],
        "rays 2": {"trace.rays": 2, "trace.object_rays": 16},
        "rays 4": {"trace.rays": 4, "trace.object_rays": 32, "iprt.ratio_rows": 128},
        "accurate": PRESETS["accurate"],
    }
)
"""Settings by the name of an entry, where they differ from the defaults."""
KEYS = tuple(dict.fromkeys(key for entry in LADDER.values() for key in entry))
"""Settings in which entries differ."""


def entry_settings(name: str) -> dict[str, object]:
    """The value of each of `KEYS` in an entry."""
    return {key: value for key, value in plain_values(Settings()).items() if key in KEYS} | dict(
        LADDER[name]
    )


def entry_assignments(name: str) -> list[Assignment]:
    """The same as assignments: over a preset, they replace all that it sets."""
    return [Assignment(k, v, f"entry '{name}': {k}") for k, v in entry_settings(name).items()]
