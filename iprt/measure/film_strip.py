"""Film strip of a played video: frames side by side for visual inspection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from iprt.measure import metrics
from iprt.measure.compare import DIFFERENCE_GAIN, difference
from iprt.measure.results import json_text
from iprt.output.picture import write_display_png

COLUMNS = 8


class FilmStrip:
    """Up to eight evenly spaced frames, cropped to the last of a view's cuts.

    Below each frame are its converged picture and their difference, if known.

    Parameters
    ----------
    indices : sequence of int
        Indices of the played frames.
    cuts : sequence of (x0, y0, x1, y1)
        Crops in pixels of the pictures.
    """

    def __init__(self, indices: Sequence[int], cuts: Sequence[metrics.Cut]) -> None:
        count = min(COLUMNS, len(indices))
        places = np.linspace(0, len(indices) - 1, count).round().astype(int)
        self._wanted = {indices[place] for place in places}
        self._cut = cuts[-1] if cuts else None
        self._columns: dict[int, metrics.Image] = {}

    def add(self, index: int, shown: metrics.Image, converged: metrics.Image | None) -> None:
        """Keep a frame (H, W, 3) if it belongs to the strip."""
        if index not in self._wanted:
            return
        parts = [shown]
        if converged is not None:
            parts += [converged, difference(shown, converged)]
        if self._cut is not None:
            x0, y0, x1, y1 = self._cut
            parts = [part[y0:y1, x0:x1] for part in parts]
        self._columns[index] = np.concatenate(parts, axis=0)

    def write(self, path: Path, figures: Mapping[str, object]) -> None:
        """Write a PNG with `figures` as metadata."""
        columns = [self._columns[index] for index in sorted(self._columns)]
        write_display_png(
            path,
            np.concatenate(columns, axis=1),
            metadata={
                "iprt:frames": ", ".join(map(str, sorted(self._columns))),
                "iprt:rows": f"render, converged, absolute difference x{DIFFERENCE_GAIN:g}",
                "iprt:figures": json_text(figures),
            },
        )
