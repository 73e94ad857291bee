#!/usr/bin/env python3
"""Fill the forecast of docs/farm_studio.md: `python docs/farm_scale.py`.

It takes seconds: `iprt.farm.model` simulates a film of an hour in 4K on up to 1000 workers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from iprt.farm.model import Farm, FilmCost, best_forecast, forecast
from iprt.farm.plan import (
    CHUNKS,
    DEAD_S,
    HALF,
    JOIN_S,
    SPREAD,
    TASK_S,
    duration,
    fade_bytes,
    movie_bytes,
)
from iprt.output.chunks import LENGTH, WARM_UP
from iprt.output.grid import Grid

PAGE = Path(__file__).with_name("farm_studio.md")
START, END = "<!-- forecast by docs/farm_scale.py -->", "<!-- end -->"

FRAMES, PIXELS = 3600 * 30, 3840 * 2160
SOURCE = 10e6
"""Bytes of a frame of the footage: colors of a video file, and 16-bit depth."""
FRAME_S = (0.1, 0.5, 2.0)
WORKERS = (1, 10, 100, 1000)
STORAGE = (1e9, 10e9)
FARM = Farm(1, start_s=5.0, task_s=TASK_S, spread=SPREAD, deaths=0.01, lost_s=DEAD_S)
COLUMNS = ("s/frame", "workers", "time", "limited by", "busy", "best chunk", "time", "limited by")


def film(frame_s: float) -> FilmCost:
    """Return the cost of an hour of 4K as a video file."""
    frame, fade = movie_bytes(PIXELS, 8) + SOURCE, fade_bytes(PIXELS, WARM_UP, HALF)
    return FilmCost(FRAMES, WARM_UP, frame_s, frame, fade, JOIN_S * FRAMES)


def grid(farm: Farm, frame_s: Sequence[float] = FRAME_S) -> Grid:
    """Return the table for a farm."""
    rows = []
    for seconds in frame_s:
        hour = film(seconds)
        for workers in WORKERS:
            farm = replace(farm, workers=workers)
            given, best = forecast(hour, farm, LENGTH), best_forecast(hour, farm, CHUNKS)
            busy = FRAMES * seconds / (workers * given.seconds)
            shown = duration(given.seconds), given.limit, f"{busy:.0%}"
            better = str(best.chunk), duration(best.seconds), best.limit
            rows.append((f"{seconds:g}", f"{workers:,}", *shown, *better))
    return Grid("", COLUMNS, tuple(rows), words=0)


def page_part() -> str:
    """Build the text between `START` and `END`."""
    hour = film(1.0)
    through = hour.frame_bytes * (1 + WARM_UP / LENGTH) + hour.chunk_bytes / LENGTH
    parts = [
        f"Through the storage go {through / 1e6:.0f} MB for each frame of the film: "
        f"{SOURCE / 1e6:.0f} MB of footage, {movie_bytes(PIXELS, 8) / 1e6:.0f} MB of planes that "
        "are written and read, and the rest for fades and warm-ups. "
        f"The film has {through * FRAMES / 1e12:.1f} TB."
    ]
    for storage in STORAGE:
        parts.append(f"With a storage of {storage / 1e9:g} GB/s:")
        parts.append(grid(replace(FARM, storage=storage)).markdown().strip())
    parts.append(f"The same, if workers die once an hour on average, at {FRAME_S[-1]:g} s a frame:")
    dying = replace(FARM, storage=STORAGE[-1], deaths=1.0)
    parts.append(grid(dying, FRAME_S[-1:]).markdown().strip())
    return "\n\n".join(parts)


def main() -> None:
    """Fill the page."""
    page = PAGE.read_text(encoding="utf-8")
    pattern = f"{re.escape(START)}.*?{re.escape(END)}"
    filled = re.sub(pattern, lambda _: f"{START}\n\n{page_part()}\n\n{END}", page, flags=re.DOTALL)
    PAGE.write_text(filled, encoding="utf-8")


if __name__ == "__main__":
    main()
