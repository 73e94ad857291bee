"""Plan of a film: everything that finishing it needs, apart from its frames."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

from iprt.output.chunks import Chunks
from iprt.output.encode import CodecName
from iprt.output.sound import Sound


@dataclass(frozen=True)
class FilmPlan:
    """Identity of a film, and the way its frames become files.

    Attributes
    ----------
    identity : mapping of str to str
        Metadata of all frames; frames of another identity belong to another film.
    chunks : Chunks
    exposure : float
        For display-referred formats.
    codec : {"h264", "hevc"}
    rate : Fraction
        Frames a second.
    spherical : bool
        Mark a video file as a panorama.
    sound : Sound or None
    """

    identity: Mapping[str, str]
    chunks: Chunks
    exposure: float
    codec: CodecName
    rate: Fraction
    spherical: bool
    sound: Sound | None

    @property
    def frames(self) -> range:
        """Numbers of the film's frames."""
        return self.chunks.frames

    def to_json(self) -> str:
        """Return the plan as JSON."""
        chunks, sound = self.chunks, self.sound
        values = {
            "identity": dict(self.identity),
            "there": _ends(chunks.there),
            "frames": _ends(chunks.frames),
            "chunk": chunks.length,
            "warm_up": chunks.warm_up,
            "exposure": self.exposure,
            "codec": self.codec,
            "rate": str(self.rate),
            "spherical": self.spherical,
            "sound": sound and [str(sound.path), str(sound.start), str(sound.length)],
        }
        return json.dumps(values, indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str) -> FilmPlan:
        """Return the plan that `to_json` has written.

        Raises
        ------
        ValueError
            The text is something else.
        """
        try:
            values = json.loads(text)
            there, frames = (range(*values[name]) for name in ("there", "frames"))
            sound = values["sound"]
            return cls(
                {str(key): str(value) for key, value in values["identity"].items()},
                Chunks(there, frames, int(values["chunk"]), int(values["warm_up"])),
                float(values["exposure"]),
                cast(CodecName, values["codec"]),
                Fraction(values["rate"]),
                bool(values["spherical"]),
                sound and Sound(Path(sound[0]), Fraction(sound[1]), Fraction(sound[2])),
            )
        except (AttributeError, IndexError, KeyError, TypeError) as error:
            raise ValueError(f"no plan of a film: {error}") from error


def _ends(numbers: range) -> list[Any]:
    return [numbers.start, numbers.stop, numbers.step]
