"""`iprt settings`: every setting with its value, ready to be edited."""

from __future__ import annotations

from iprt.commands.setting_flags import BALANCED, ChosenSettings


def settings(*, setting_flags: ChosenSettings = BALANCED) -> int:
    """Print all settings as a TOML file for --settings, each with its meaning, bounds and default.

    Settings at their default are commented out: they leave the choice to --quality.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.settings.overrides import settings_toml

    quality = setting_flags.quality
    title = f"Settings of iprt, from quality {quality}. Remove the # before a setting to set it."
    print(settings_toml(setting_flags.resolved(), title), end="")
    return 0
