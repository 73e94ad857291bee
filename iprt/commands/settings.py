"""`iprt settings`: every setting with its value, as a file to edit."""

from __future__ import annotations

import json as json_format
import os
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.commands.setting_flags import BALANCED, ChosenSettings, SettingFlags

if TYPE_CHECKING:
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings


def settings(
    scene: tyro.conf.Positional[Path | None] = None,
    /,
    *,
    where: bool = False,
    json: bool = False,
    setting_flags: ChosenSettings = BALANCED,
    allow_outside: bool = False,
) -> int:
    """Print all settings as a TOML file for --settings, each with its meaning, bounds and default.

    Settings at their default are commented out: they leave the choice to --quality. The file may
    also become the user's own, which `--where` names, or the table [settings] of a scene.toml.

    Parameters
    ----------
    scene
        Scene folder whose [settings] count too.
    where
        Print a table of the values in effect instead, and where each comes from.
    json
        Print the same as JSON.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.device.choose import VARIABLE
    from iprt.output.grid import Grid, print_grid
    from iprt.scene.scene import Scene
    from iprt.settings.overrides import plain_values, settings_toml
    from iprt.settings.user import user_file

    opened = None if scene is None else Scene.open(scene, allow_outside=allow_outside)
    chosen = setting_flags.resolved(opened)
    if not (where or json):
        title = f"Settings of iprt, from quality {setting_flags.quality}. "
        print(settings_toml(chosen, f"{title}Remove the # before a setting to set it."), end="")
        return 0
    values, sources = plain_values(chosen), _sources(chosen, setting_flags, opened)
    device = os.environ.get(VARIABLE) or None
    if json:
        record = {
            "user_file": str(user_file()),
            "device": device,
            "settings": {key: {"value": values[key], "from": sources[key]} for key in values},
        }
        print(json_format.dumps(record, indent=2, ensure_ascii=False))
        return 0
    print_grid(
        Grid(
            "settings in effect",
            ("setting", "value", "from"),
            tuple((key, json_format.dumps(values[key]), sources[key]) for key in values),
            notes=(
                "Later ones win: preset, user's file, scene, environment, --settings, --set.",
                f"user's file: {user_file()}",
                f"device: {device or 'the fastest'} ({VARIABLE})",
            ),
            words=3,
        )
    )
    return 0


def _sources(chosen: Settings, flags: SettingFlags, scene: Scene | None) -> dict[str, str]:
    """Return the source of each setting's value, by its key."""
    from iprt.settings.methods import methods
    from iprt.settings.overrides import all_settings, preset_settings

    found = dict.fromkeys(all_settings(), "default")
    found |= dict.fromkeys(methods()[chosen.method].defaults, f"default of {chosen.method}")
    for item in [*preset_settings(flags.quality), *flags.assignments(scene)]:
        found[item.key] = item.source
    return found
