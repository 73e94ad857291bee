"""Command line by which another process, or another machine, renders chunks of a film."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import tomlkit

from iprt.commands.render_flags import RenderFlags
from iprt.commands.render_job import RenderJob
from iprt.files.atomic import replacing
from iprt.output.parts import parts_of
from iprt.settings.overrides import plain_values

SETTINGS = "settings.toml"
IN_SETTINGS = ("seed", "method", "time_per_frame", "ssim", "setting_flags")
"""Flags whose values end up in the settings."""


def write_settings(job: RenderJob) -> Path:
    """Write all settings of a job to the folder of its parts; return the file.

    Settings of a machine's user or of its environment change nothing then.

    Raises
    ------
    FormatError
        It cannot be written.
    """
    file = parts_of(job.output).absolute() / SETTINGS
    lines = (
        f"{key} = {tomlkit.item(value).as_string()}"
        for key, value in plain_values(job.settings).items()
    )
    with replacing(file) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "utf-8")
    return file


def render_words(scene: Path, flags: RenderFlags, settings: Path) -> list[str]:
    """Return the words behind `iprt` that render the same film, with absolute paths.

    Parameters
    ----------
    scene : Path
        Scene folder.
    settings : Path
        File by `write_settings`.
    """
    words = ["render", str(scene.absolute()), f"--settings={settings}"]
    for field in fields(flags):
        name, value = field.name, getattr(flags, field.name)
        flag = f"--{name.replace('_', '-')}"
        if name in IN_SETTINGS or value == field.default:
            continue
        if value is True:
            words.append(flag)
        elif name == "size":
            words += [flag, *map(str, value)]
        elif name == "aov":
            words += [f"{flag}={layer}" for layer in value]
        else:
            shown = value.absolute() if isinstance(value, Path) else value
            words.append(f"{flag}={shown!r}" if isinstance(shown, float) else f"{flag}={shown}")
    return words
