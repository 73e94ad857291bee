"""`iprt methods`: list of the installed relighting methods."""

from __future__ import annotations

import json as json_format
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from iprt.settings.overrides import Setting


def methods(*, json: bool = False) -> int:
    """List the relighting methods: what each does, its paper, and its own settings.

    Parameters
    ----------
    json
        Print a JSON object with the methods' names as keys.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.settings.methods import methods as installed
    from iprt.settings.overrides import all_settings

    own = {name: [s for s in all_settings().values() if s.group == name] for name in installed()}
    if json:
        record = {
            name: {
                "title": info.title,
                "paper": info.paper,
                "doi": info.doi,
                "settings": {setting.key: setting.default for setting in own[name]},
                "defaults": dict(info.defaults),
            }
            for name, info in installed().items()
        }
        print(json_format.dumps(record, indent=2, ensure_ascii=False))
        return 0
    for name, info in installed().items():
        lines = [info.title]
        if info.paper:
            lines.append(info.paper + (f", https://doi.org/{info.doi}" if info.doi else ""))
        lines += [_described(setting) for setting in own[name]]
        lines += [f"{key} = {_plain(value)} by default" for key, value in info.defaults.items()]
        print(name, *(f"    {line}" for line in lines), sep="\n")
    return 0


def _described(setting: Setting) -> str:
    return f"{setting.key} ({setting.allowed}; default {_plain(setting.default)})"


def _plain(value: object) -> str:
    return json_format.dumps(value)
