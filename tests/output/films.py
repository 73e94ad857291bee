"""Films of tiny pictures that tell of which frame, and of which side of a fade, they are."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np

from iprt.output.chunks import Chunks
from iprt.output.film_output import FilmOutput
from iprt.output.film_plan import FilmPlan
from iprt.output.sound import Sound
from iprt.renderer import RenderedFrame
from tests.output.test_frames import metadata

FRAMES = range(10, 24, 2)
RATE = Fraction(3, 2)
"""Pieces of 2 seconds are 3 pictures long."""


def picture(index: int, number: int = 0) -> RenderedFrame:
    """The picture of a frame, a little brighter by chunks of higher numbers."""
    y, x = np.mgrid[0:16, 0:32]
    blue = np.full(x.shape, 0.04 * index + 0.01 * number)
    color = np.stack([x / 32.0, y / 16.0, blue], axis=-1)
    return RenderedFrame(color.astype(np.float32), {})


def plan(
    frames: range = FRAMES,
    *,
    there: range = range(24),
    chunk: int = 120,
    warm_up: int = 8,
    rate: Fraction = RATE,
    sound: Sound | None = None,
    **changed: str,
) -> FilmPlan:
    """The plan of a film; `changed` metadata."""
    identity = {k: v for k, v in metadata().items() if k not in ("iprt:device", "iprt:frame")}
    chunks = Chunks(there, frames, chunk, warm_up)
    return FilmPlan({**identity, **changed}, chunks, 1.0, "h264", rate, False, sound)


def opened(path: Path, given: FilmPlan | None = None, *numbers: int) -> FilmOutput:
    """The output of a film, for all its chunks or these."""
    given = given or plan()
    path.parent.mkdir(exist_ok=True, parents=True)
    return FilmOutput(path, given, numbers or given.chunks.numbers)


def render(target: FilmOutput, stop: int | None = None) -> list[int]:
    """Write missing frames of the chunks of an output, at most `stop`; return their numbers."""
    written: list[int] = []
    for number in target.numbers:
        for index in target.missing(number):
            if len(written) == stop:
                return written
            target.write(number, index, picture(index, number), "a device")
            written.append(index)
        target.fade(number)
    return written


def whole(path: Path, given: FilmPlan | None = None) -> Path:
    """A whole film by one process."""
    target = opened(path, given)
    render(target)
    target.finish()
    return path


def contents(path: Path) -> dict[str, bytes]:
    """Bytes of a file or of the files of a folder, by name."""
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return {"" if each == path else each.name: each.read_bytes() for each in files}
