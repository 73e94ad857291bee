"""A ladder of settings from the fastest to the most accurate, each entry worth its cost.

`iprt.measure.tradeoff` measures time and quality of the entries.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from iprt.settings.model import Settings
from iprt.settings.overrides import Assignment, plain_values
from iprt.settings.presets import PRESETS

BALANCED = "balanced"
"""The entry that all times are relative to."""

_DRAFT = PRESETS["draft"]
LADDER: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        "light 8": {**_DRAFT, "light_scale": 8, "iprt.ratio_rows": 16, "atrous.levels": 2},
        "draft": _DRAFT,
        "light 2": {**_DRAFT, "light_scale": 2, "atrous.levels": 4},
        "light 2, rays 2": {"light_scale": 2, "trace.rays": 2, "trace.object_rays": 16},
        "balanced": PRESETS["balanced"],
        "rays 2": {"trace.rays": 2, "trace.object_rays": 16},
        "rays 4": {"trace.rays": 4, "trace.object_rays": 32, "iprt.ratio_rows": 128},
        "accurate": PRESETS["accurate"],
    }
)
"""Settings of each entry by its name, where they differ from the defaults."""
KEYS = tuple(dict.fromkeys(key for entry in LADDER.values() for key in entry))
"""Settings that differ between entries."""


def entry_settings(name: str) -> dict[str, object]:
    """Return the value of each of `KEYS` in an entry."""
    return {key: value for key, value in plain_values(Settings()).items() if key in KEYS} | dict(
        LADDER[name]
    )


def entry_assignments(name: str) -> list[Assignment]:
    """Return an entry as assignments, which override all values of a preset."""
    return [Assignment(k, v, f"entry '{name}': {k}") for k, v in entry_settings(name).items()]
