"""Help texts of the verbs: their docstrings, laid out for tyro."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import is_dataclass
from typing import Annotated, Any, get_type_hints

import tyro

CONFIG = (
    tyro.conf.DisallowNone,
    tyro.conf.FlagCreatePairsOff,
    tyro.conf.PositionalMetavarFromFieldName,
)
"""Rules by which tyro turns parameters into arguments: `--json` without `--no-json`, `SCENE` for a
path."""


METAVARS = {
    "accumulate": "N",
    "animation": "NAME",
    "at_once": "N",
    "aov": "LAYER",
    "chunk": "N",
    "chunks": "N-N,...",
    "color_layer": "LAYER",
    "deaths_per_hour": "N",
    "depth_layer": "LAYER",
    "depth_scale": "METRES",
    "device": "DEVICE",
    "every": "N",
    "fail_under_ssim": "SSIM",
    "fov": "DEGREES",
    "frame_limit": "SECONDS",
    "frames": "FIRST:LAST",
    "gpus": "N",
    "height": "METRES",
    "material": "MATERIAL",
    "method": "METHOD",
    "minutes": "MINUTES",
    "model": "MODULE",
    "name": "NAME",
    "pitch": "DEGREES",
    "reach": "SSIM,...",
    "repeat": "N",
    "rotate": "DEGREES",
    "seconds": "SECONDS,...",
    "seconds_per_frame": "SECONDS",
    "seed": "N",
    "seeds": "N",
    "spp": "N",
    "ssim": "SSIM",
    "start_seconds": "SECONDS",
    "storage": "GB/S",
    "time_per_frame": "SECONDS",
    "unit": "UNIT",
    "view": "NAME",
    "workers": "N,N,...",
    "yaw": "DEGREES",
}
"""Placeholders of flags' values by parameter, where the type is not informative."""


def explained(function: Callable[..., int | None]) -> Callable[..., int | None]:
    """Prepare a verb's function for tyro: paragraphs that it can wrap, informative defaults.

    tyro would keep the docstring's line breaks, and show a default of None.
    """
    _explain(function)
    for kind in get_type_hints(function).values():
        if is_dataclass(kind) and isinstance(kind, type) and kind not in _EXPLAINED:
            _EXPLAINED.add(kind)
            _explain(kind)
    return function


_EXPLAINED: set[type] = set()
"""Classes of flags that are prepared; verbs share them."""


def _explain(owner: Any) -> None:
    """Prepare the docstring and the annotations of a function or a dataclass."""
    owner.__doc__ = unwrapped(inspect.getdoc(owner) or "")
    owner.__annotations__ = {
        name: Annotated[kind, plain_default(_metavar(name, kind))] if name != "return" else kind
        for name, kind in get_type_hints(owner, include_extras=True).items()
    }


def _metavar(name: str, kind: Any) -> str | None:
    """Return the placeholder of a flag's value in its help; None: its type."""
    if kind is bool:
        return None
    return "N,N,..." if (name, kind) == ("accumulate", str) else METAVARS.get(name)


def plain_default(metavar: str | None = None) -> Any:
    """Return the annotation of a parameter whose default is shown only if it is informative."""
    return tyro.conf.arg(help_behavior_hint=_default, metavar=metavar)


def unwrapped(text: str) -> str:
    """Return a docstring with each paragraph on one line, parameters' descriptions included."""
    lines: list[str] = []
    prose, indent = True, ""
    for line in text.splitlines():
        prose = prose and line not in ("Parameters", "Attributes")
        words = line.strip()
        follows = bool(lines and lines[-1] and words) and line.startswith(indent)
        if follows and (prose or (indent and lines[-1].startswith(indent))):
            lines[-1] += " " + words
        else:
            lines.append(line)
        indent = "" if prose else "    "
    return "\n".join(lines)


def _default(value: str) -> str:
    """Return the note about a default value; the texts themselves explain a missing value."""
    return "" if value in ("", "None", "False", "True") else f"(default: {value})"
