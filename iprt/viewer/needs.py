"""Requirements of the viewers, which `iprt view` and `iprt doctor` check."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from iprt.device.install import pip_command, requirements
from iprt.errors import DeviceError, IprtError

WINDOW = ("imgui_bundle", "glfw")
"""Modules of the viewer in a window. imgui comes first, so that both use its library of GLFW."""
BROWSER = ("viser",)
ELSEWHERE = "open it from a desktop session, or view the scene in a browser: iprt view --web"


def require_window() -> None:
    """Refuse to open a window where that cannot work.

    Raises
    ------
    IprtError
        A package is missing; the message holds the command that installs it.
    DeviceError
        There is no display.
    """
    _require_modules(WINDOW)
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)
        works = glfw.init()
    if not works:
        reason: Any = glfw.get_error()[1]  # bytes, whatever its stub says
        raise DeviceError(f"no window can be opened ({reason.decode()}); {ELSEWHERE}")


def require_browser() -> None:
    """Refuse to serve browsers where that cannot work.

    Raises
    ------
    IprtError
        A package is missing; the message holds the command that installs it.
    """
    _require_modules(BROWSER)


def lacking(names: Sequence[str]) -> list[str]:
    """Errors of modules, a clause for each that cannot be imported."""
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
