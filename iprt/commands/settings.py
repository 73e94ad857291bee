"""`iprt settings`: every knob with its value, ready to be edited."""

from __future__ import annotations

from iprt.commands.knobs import BALANCED, Knobs


def settings(*, knobs: Knobs = BALANCED) -> int:
    """Print all knobs as a TOML file for --settings, each with its meaning, bounds and default.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.knobs import settings_toml

    title = f"Settings of iprt, from quality {knobs.quality}. Lines may be left out."
    print(settings_toml(knobs.resolved(), title), end="")
    return 0
