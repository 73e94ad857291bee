"""Table of the forecast times of a film, by the number of workers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from iprt.farm.model import Farm, FilmCost, best_forecast, forecast
from iprt.output.chunks import fade
from iprt.output.grid import Grid

CHUNKS = (8, 16, 24, 32, 48, 60, 90, 120, 180, 240, 360, 480, 600, 900, 1200, 1800, 3600)
"""Lengths among which the best is sought."""
TASK_S, SPREAD, DEAD_S = 0.01, 0.1, 120.0
"""Values for `Farm.task_s`, `spread` and `lost_s` where nothing else is known."""
JOIN_S = 0.001
"""Seconds of the join for each frame of a video file."""
COLUMNS = ("workers", "chunk", "time", "limited by", "best chunk", "time", "limited by")
FULL, HALF = 4, 2
"""Bytes of a value in the sides of a fade: for EXR files, and otherwise."""


def grid(film: FilmCost, farm: Farm, workers: Sequence[int], chunk: int) -> Grid:
    """Return a table with a row for each number of workers.

    Parameters
    ----------
    farm : Farm
        With any number of workers.
    chunk : int
        Frames of a chunk, beside which the best is shown.
    """
    chunks = [length for length in CHUNKS if film.warm_up <= length <= film.frames]
    rows = []
    for count in workers:
        crowd = replace(farm, workers=count)
        found = forecast(film, crowd, chunk), best_forecast(film, crowd, [*chunks, chunk])
        cells = ((str(one.chunk), duration(one.seconds), one.limit) for one in found)
        rows.append((f"{count:,}", *(cell for part in cells for cell in part)))
    return Grid("forecast", COLUMNS, tuple(rows))


def movie_bytes(pixels: int, bits: int) -> float:
    """Return the bytes of a frame of a video file that pass through the storage.

    Its planes (4:2:0) are written, and read when their piece is encoded, which is small.
    """
    return 2 * 1.5 * pixels * (1 if bits == 8 else 2)


def fade_bytes(pixels: int, warm_up: int, value: int, layers: int = 1) -> float:
    """Return the bytes of a fade that pass through the storage.

    Parameters
    ----------
    value : int
        `FULL` or `HALF`.
    layers : int
        Pictures of a frame: its colors and auxiliary layers.
    """
    passes = 4  # two sides are written, and read
    return passes * fade(warm_up) * 3 * value * layers * pixels


def duration(seconds: float) -> str:
    """Format a time in its two largest units: `2 d 5 h`, `3 h 20 min`, `4 min 5 s`, `12 s`."""
    total = round(seconds)
    days, hours, minutes = total // 86400, total // 3600 % 24, total // 60 % 60
    if days:
        return f"{days} d {hours} h"
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {total % 60} s" if minutes else f"{total} s"
