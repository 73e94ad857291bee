"""Settings of the user, which hold below the flags of a command: a file and the environment."""

from __future__ import annotations

import os
import re
from pathlib import Path

from platformdirs import user_config_path

from iprt.settings.overrides import Assignment, all_settings, parse_assignment, read_settings

FILE_NAME = "settings.toml"


def user_file() -> Path:
    """Return where the user's settings are: `~/.config/iprt/settings.toml` on Linux."""
    return user_config_path("iprt") / FILE_NAME


def user_settings() -> list[Assignment]:
    """Return the assignments of the user's file; none where there is no file.

    Raises
    ------
    IprtError
        See `read_settings`.
    """
    file = user_file()
    return read_settings(file) if os.path.lexists(file) else []


def variable(key: str) -> str:
    """Return the environment variable of a setting: `IPRT_TRACE_RAYS` of `trace.rays`."""
    return "IPRT_" + re.sub(r"\W", "_", key).upper()


def environment_settings() -> list[Assignment]:
    """Return the assignments of environment variables; empty ones do not count.

    Raises
    ------
    IprtError
        See `parse_assignment`.
    """
    if not any(name.startswith("IPRT_") for name in os.environ):
        return []  # a list of all settings takes a while
    found = []
    for key in all_settings():
        name = variable(key)
        if os.environ.get(name, "").strip():
            item = parse_assignment(name, f"{key}={os.environ[name]}")
            found.append(Assignment(key, item.value, f"{name}={os.environ[name]}"))
    return found
