"""Help texts of the verbs: their docstrings, laid out for tyro."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

import tyro

CONFIG = (
    tyro.conf.DisallowNone,
    tyro.conf.FlagCreatePairsOff,
    tyro.conf.PositionalMetavarFromFieldName,
)
"""How tyro turns parameters into arguments: `--json` without `--no-json`, `SCENE` for a path."""


def explained(function: Callable[..., int | None]) -> Callable[..., int | None]:
    """Prepare a verb's function for tyro: paragraphs that it may wrap, defaults that say something.

    tyro breaks lines where the docstring does, and shows a default of None as it is.
    """
    function.__doc__ = unwrapped(inspect.getdoc(function) or "")
    function.__annotations__ = {
        name: Annotated[kind, plain_default()] if name != "return" else kind
        for name, kind in get_type_hints(function, include_extras=True).items()
    }
    return function


def plain_default(metavar: str | None = None) -> Any:
    """Annotation of a parameter that shows its default only where that says something."""
    return tyro.conf.arg(help_behavior_hint=_default, metavar=metavar)


def unwrapped(text: str) -> str:
    """A docstring with each indented paragraph on one line."""
    lines: list[str] = []
    for line in text.splitlines():
        if lines and lines[-1].startswith("    ") and line.startswith("    "):
            lines[-1] += " " + line.strip()
        else:
            lines.append(line)
    return "\n".join(lines)


def _default(value: str) -> str:
    """Default value that follows an explanation; texts say themselves what no value means."""
    return "" if value in ("", "None", "False", "True") else f"(default: {value})"
