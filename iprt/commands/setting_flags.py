"""The flags by which verbs take a quality preset and single settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from iprt.commands.help import plain_default
from iprt.errors import IprtError
from iprt.settings.presets import STILL, Quality

if TYPE_CHECKING:
    from iprt.settings.model import Settings
    from iprt.settings.overrides import Assignment


@dataclass(frozen=True)
class SettingFlags:
    """`iprt settings` prints all settings. Later ones win: preset, file, flags."""

    quality: Quality = "balanced"
    """Preset of all settings: speed against accuracy."""
    settings: Annotated[Path | None, plain_default()] = None
    """TOML file of settings, such as `iprt settings` prints."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], plain_default("KEY=VALUE")] = ()
    """Value of one setting, such as trace.rays=4; may be given several times."""

    def resolved(
        self, *, still: bool = False, under: Sequence[Assignment] = (), **short: object
    ) -> Settings:
        """The settings asked for.

        Parameters
        ----------
        still : bool
            For pictures in which nothing moves.
        under : sequence of Assignment
            What wins over the preset, and nothing else.
        short
            Values of the verb's own flags for settings, by the setting's name; None: not given.

        Raises
        ------
        IprtError
            A key is no setting, a value is not allowed, or a setting is given twice.
        """
        from iprt.settings.overrides import resolved

        return resolved(self.quality, [*under, *self.assignments(still=still, **short)])

    def assignments(self, *, still: bool = False, **short: object) -> list[Assignment]:
        """Settings of file and flags, later ones override; see `resolved`."""
        from iprt.settings.overrides import Assignment, parse_assignment, read_settings

        file = [] if self.settings is None else read_settings(self.settings)
        flags = [parse_assignment("--set", text) for text in self.set]
        given = {flag.key: flag for flag in flags}
        for key, value in short.items():
            if value is None:
                continue
            if key in given:
                raise IprtError(f"{given[key].source} and --{key} {value}: give one of them")
            flags.append(Assignment(key, value, f"--{key} {value}"))
        return [*file, *flags, *(fixed_when_still(flags) if still else [])]


def fixed_when_still(given: Sequence[Assignment]) -> list[Assignment]:
    """Settings of pictures in which nothing moves, whatever a settings file says.

    Raises
    ------
    IprtError
        A flag sets it, in vain.
    """
    from iprt.settings.overrides import Assignment

    for item in given:
        if item.key in STILL:
            raise IprtError(
                f"{item.source}: has no effect on a still picture, which averages all its frames"
            )
    return [Assignment(key, value, key) for key, value in STILL.items()]


ChosenSettings = Annotated[SettingFlags, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="settings")]
"""The same as a parameter of a verb: `--quality`, `--settings` and `--set`."""

BALANCED = SettingFlags()
