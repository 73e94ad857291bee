"""Edits of a scene's light and reflections, and writing them to `[video]` of `scene.toml`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from pydantic import ValidationError
from tomlkit.items import Comment, Table, Whitespace

from iprt.errors import SceneError
from iprt.files.toml_tables import describe
from iprt.footage.video.video_table import SunTable, VideoTable
from iprt.scene.manifest_writing import inline

GlossChoice = Literal["auto", "declared"]
SunChoice = SunTable | Literal["auto", "none"]
SkyChoice = Literal["auto", "none"]
PARTS = ("gloss", "sun", "sky")
"""The keys of `[video]` that choose light and reflections."""


@dataclass(frozen=True)
class LightEdit:
    """Differences of light and reflections from the scene's file.

    Attributes
    ----------
    gloss, sun, sky
        Values of these keys of `[video]`; None where the file's own holds.
    """

    gloss: GlossChoice | None = None
    sun: SunChoice | None = None
    sky: SkyChoice | None = None

    @property
    def parts(self) -> dict[str, Any]:
        """The edited values by key."""
        values = {part: getattr(self, part) for part in PARTS}
        return {part: value for part, value in values.items() if value is not None}

    def differing(self, other: LightEdit) -> tuple[str, ...]:
        """Return the keys of values that differ in another edit."""
        return tuple(part for part in PARTS if getattr(self, part) != getattr(other, part))

    def besides(self, other: LightEdit) -> LightEdit:
        """Return the edit without the values that another one has too."""
        same: dict[str, Any] = {part: None for part in PARTS if part not in self.differing(other)}
        return replace(self, **same)

    def applied(self, video: VideoTable) -> VideoTable:
        """Return the table `[video]` with the edited values."""
        return video.model_copy(update=self.parts)


UNEDITED = LightEdit()


def sun_table(
    direction: Sequence[float], irradiance: Sequence[float], angle_deg: float
) -> SunTable:
    """Return `[video.sun]` of a sun, rounded to the accuracy with which suns are found.

    Parameters
    ----------
    direction : three floats
        Towards the sun, in world space.
    irradiance : three floats
    angle_deg : float

    Raises
    ------
    SceneError
        No file may hold it, in one line.
    """
    values = {
        "direction": [round(float(part), 4) for part in direction],
        "irradiance": [float(f"{float(part):.3g}") for part in irradiance],
        "angle_deg": float(f"{angle_deg:.4g}"),
    }
    try:
        return SunTable.model_validate(values)
    except ValidationError as error:
        fault = {**error.errors()[0]}
        raise SceneError(f"the sun: {describe(fault, values, SunTable)}") from None


def towards(yaw_deg: float, pitch_deg: float) -> tuple[float, float, float]:
    """Return the unit vector of a direction; yaw 0 is -Z, and 90 is +X."""
    yaw, pitch = math.radians(yaw_deg), math.radians(pitch_deg)
    across = math.cos(pitch)
    return across * math.sin(yaw), math.sin(pitch), -across * math.cos(yaw)


def angles_of(direction: Sequence[float]) -> tuple[float, float]:
    """Return yaw and pitch in degrees of a vector, of any length."""
    x, y, z = direction
    return math.degrees(math.atan2(x, -z)), math.degrees(math.atan2(y, math.hypot(x, z)))


def write_light(document: Any, edit: LightEdit) -> None:
    """Change the keys of `[video]` of a parsed `scene.toml` (tomlkit)."""
    video = document["video"]
    for key, value in edit.parts.items():
        if not isinstance(value, SunTable):
            _replace(video, key, value)
        elif isinstance(table := video.get(key), Table):
            for name, number in value.model_dump().items():
                _set(table, name, number)
        else:
            _replace(video, key, inline(value.model_dump()))


def _replace(video: Any, key: str, value: Any) -> None:
    """Set a key of `[video]`, and keep the comments below a table that had been there."""
    known = video.get(key)
    if not isinstance(known, Table):
        _set(video, key, value)
        return
    below = _cut_below(known)
    video.remove(key)
    _set(video, key, value)
    for line in below:
        video.add(line)


def _set(table: Any, key: str, value: Any) -> None:
    """Set a key; a new one comes before the blank lines and comments that end the table."""
    below = _cut_below(table) if key not in table and isinstance(table, Table) else []
    table[key] = value
    for line in below:
        table.add(line)


def _cut_below(table: Table) -> list[Any]:
    """Remove the blank lines and comments below the last key of a table, and return them."""
    body = table.value.body
    end = 1 + max((at for at, (key, _) in enumerate(body) if key is not None), default=-1)
    below = [line for _, line in body[end:] if isinstance(line, Comment | Whitespace)]
    del body[end:]
    return below
