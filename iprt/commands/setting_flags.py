"""Flags of verbs for a quality preset and single settings."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from iprt.commands.help import plain_default
from iprt.errors import IprtError
from iprt.settings.presets import STILL, Quality

if TYPE_CHECKING:
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings
    from iprt.settings.overrides import Assignment


LOG = logging.getLogger("iprt.settings")


@dataclass(frozen=True)
class SettingFlags:
    """Later ones win: preset, user's file, scene, environment, --settings, --set."""

    quality: Quality = "balanced"
    """Quality preset, from fastest to most accurate."""
    settings: Annotated[Path | None, plain_default()] = None
    """TOML file of settings, such as `iprt settings` prints."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], plain_default("KEY=VALUE")] = ()
    """Value of one setting, such as trace.rays=4; may be given several times."""

    def resolved(
        self,
        scene: Scene | None = None,
        *,
        still: bool = False,
        under: Sequence[Assignment] = (),
        **short: object,
    ) -> Settings:
        """Return the settings of all sources.

        Parameters
        ----------
        scene : Scene, optional
            Its `[settings]` are included.
        still : bool
            For pictures in which nothing moves.
        under : sequence of Assignment
            Settings that take precedence over the preset alone.
        short
            Values of the verb's own flags for settings, by the setting's name; None: not given.

        Raises
        ------
        IprtError
            A key is no setting, a value is not allowed, or a setting is given twice.
        """
        from iprt.settings.overrides import resolved

        return resolved(self.quality, [*under, *self.assignments(scene, still=still, **short)])

    def assignments(
        self, scene: Scene | None = None, *, still: bool = False, **short: object
    ) -> list[Assignment]:
        """Return all settings but the preset's; later ones take precedence. See `resolved`."""
        from iprt.settings.overrides import (
            Assignment,
            parse_assignment,
            read_settings,
            table_settings,
        )
        from iprt.settings.user import environment_settings, user_settings

        file = [] if self.settings is None else read_settings(self.settings)
        flags = [parse_assignment("--set", text) for text in self.set]
        given = {flag.key: flag for flag in flags}
        for key, value in short.items():
            if value is None:
                continue
            if key in given:
                raise IprtError(f"{given[key].source} and --{key} {value}: give one of them")
            flags.append(Assignment(key, value, f"--{key} {value}"))
        of_scene = [] if scene is None else table_settings(*scene.settings_table)
        lower = [*user_settings(), *of_scene, *environment_settings()]
        _tell(tuple(item.source for item in lower))
        return [*lower, *file, *flags, *(fixed_when_still(flags) if still else [])]


@cache
def _tell(sources: tuple[str, ...]) -> None:
    """Log which settings were not given on the command line, once."""
    if sources:
        LOG.info("settings from elsewhere: %s", "; ".join(sources))


def fixed_when_still(given: Sequence[Assignment]) -> list[Assignment]:
    """Return the settings that are fixed for pictures in which nothing moves.

    They override settings files.

    Raises
    ------
    IprtError
        A flag sets one of them, without effect.
    """
    from iprt.settings.overrides import Assignment

    for item in given:
        if item.key in STILL:
            raise IprtError(
                f"{item.source}: has no effect on a still picture, which averages all its frames"
            )
    return [Assignment(key, value, key) for key, value in STILL.items()]


ChosenSettings = Annotated[SettingFlags, tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="settings")]
"""`SettingFlags` as a parameter of a verb: `--quality`, `--settings` and `--set`."""

BALANCED = SettingFlags()
