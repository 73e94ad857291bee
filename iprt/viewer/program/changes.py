"""Changes of settings, as programs state them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import InstanceOf

from iprt.settings.model import Settings
from iprt.settings.overrides import Assignment, assigned, changed, parse_assignment, table_settings

Change = str | dict[str, Any] | InstanceOf[Settings]
"""An assignment `KEY=VALUE`, values by key, or all settings."""


def changed_settings(settings: Settings, changes: Sequence[Change]) -> Settings:
    """Return the settings with changes; a changed method brings its defaults.

    Raises
    ------
    IprtError
        A key is no setting, or a value is not allowed.
    """
    for change in changes:
        if isinstance(change, Settings):
            settings = change
            continue
        for item in _assignments(change):
            now = assigned(settings, [item])
            settings = changed(settings, {item.key: item.value}) if item.key == "method" else now
    return settings


def _assignments(change: str | dict[str, Any]) -> list[Assignment]:
    if isinstance(change, str):
        return [parse_assignment("set", change)]
    return table_settings(change, "set")
