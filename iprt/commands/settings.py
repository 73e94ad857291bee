"""`iprt settings`: every setting with its value, ready to be edited."""

from __future__ import annotations

from iprt.commands.knobs import BALANCED, Knobs


def settings(*, knobs: Knobs = BALANCED) -> int:
    """Print all settings as a TOML file for --settings, each with its meaning, bounds and default.

    Settings at their default are commented out: they leave the choice to --quality.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.settings.overrides import settings_toml

    title = f"Settings of iprt, from quality {knobs.quality}. Remove the # before a knob to set it."
    print(settings_toml(knobs.resolved(), title), end="")
    return 0
