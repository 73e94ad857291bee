"""Requirements of the viewers, which `iprt view` and `iprt doctor` check."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from iprt.device.install import pip_command, requirements
from iprt.errors import DeviceError, IprtError

WINDOW = ("imgui_bundle", "glfw")
"""Modules of the desktop viewer. imgui comes first, so that both use its GLFW library."""
BROWSER = ("viser",)
ELSEWHERE = "open it from a desktop session, or view the scene in a browser: iprt view --web"


def require_window() -> None:
    """Raise an error if no window can be opened.

    Raises
    ------
    IprtError
        A package is missing; the message gives the install command.
    DeviceError
        There is no display.
    """
    _require_modules(WINDOW)
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)
        works = glfw.init()
    if not works:
        reason: Any = glfw.get_error()[1]  # bytes, unlike its stub
        raise DeviceError(f"no window can be opened ({reason.decode()}); {ELSEWHERE}")


def require_browser() -> None:
    """Raise an error if browsers cannot be served.

    Raises
    ------
    IprtError
        A package is missing; the message gives the install command.
    """
    _require_modules(BROWSER)


def lacking(names: Sequence[str]) -> list[str]:
    """Return import errors, a clause for each module that cannot be imported."""
    problems = []
    for name in names:
        try:
            import_module(name)
        except ImportError as error:
            missing = isinstance(error, ModuleNotFoundError) and error.name == name
            problems.append(f"{name} is not installed" if missing else f"{name}: {error}")
    return problems


def _require_modules(names: Sequence[str]) -> None:
    if problems := lacking(names):
        raise IprtError(
            f"the viewer cannot start ({', '.join(problems)}): install the extra `view` with "
            f"`{pip_command(*requirements('view').values())}`"
        )
