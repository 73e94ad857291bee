"""Metadata of a picture, from which it can be reproduced."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from iprt import __version__
from iprt.geometry.camera import View

NAMES = {
    "chunk.frames": "--chunk",
    "files": "the scene's files",
    "frames": "--accumulate",
    "layers": "--aov",
    "span": "--frames",
    "codec": "--codec",
}
"""Names of values in messages, where they differ from the metadata's."""
PLACES = frozenset({"iprt:device", "iprt:frame"})
"""Keys in which pictures of one video may differ."""


def picture_metadata(
    *,
    scene: str,
    view: View,
    objects: tuple[str, ...] | None,
    settings: Mapping[str, object],
    seed: int,
    frames: int,
    device: str,
    noise: float | None = None,
) -> dict[str, str]:
    """Return the header attributes of a rendered picture; `iprt:view` and `iprt:settings` are JSON.

    Parameters
    ----------
    scene, device : str
        Names.
    objects : tuple of str or None
        Names of the inserted objects; None: all.
    settings : mapping
        Plain values, as `json` takes them.
    frames : int
        Frames accumulated.
    noise : float or None
        Final noise, as in `iprt.convergence`. None: not measured.
    """
    return {
        "iprt:version": __version__,
        "iprt:scene": scene,
        "iprt:view": json.dumps({**asdict(view), "objects": objects}),
        "iprt:settings": json.dumps(dict(settings), sort_keys=True),
        "iprt:seed": str(seed),
        "iprt:frames": str(frames),
        "iprt:device": device,
        **({} if noise is None else {"iprt:noise": f"{noise:.3g}"}),
    }


def difference(there: Mapping[str, str], now: Mapping[str, str]) -> str | None:
    """Return the first difference, in words, that excludes one video; None: there is none."""
    old, new = _flat(there), _flat(now)
    for key in [*new, *old]:
        if old.get(key) == new.get(key):
            continue
        if key == "files":  # hashes mean nothing to people
            return f"{NAMES[key]} have changed since"
        return f"{NAMES.get(key, key)} was {_shown(old, key)} then and is {_shown(new, key)} now"
    return None


def _flat(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return every value by its name: `view.yaw_deg`, `settings.trace.rays`."""
    values: dict[str, Any] = {}
    for key, text in metadata.items():
        if not key.startswith("iprt:") or key in PLACES:
            continue
        try:
            values[key.removeprefix("iprt:")] = json.loads(text)
        except ValueError:
            values[key.removeprefix("iprt:")] = text
    return dotted(values)


def dotted(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the values of nested mappings by dotted key."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat |= dotted(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat


def _shown(values: Mapping[str, Any], key: str) -> str:
    return json.dumps(values[key]) if key in values else "missing"
