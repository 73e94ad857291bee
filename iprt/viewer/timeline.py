"""How long the last view frames of a client took, pass by pass."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.session import Shown

MOST_FRAMES = 200
WHOLE = "frame"
"""Name of all passes together."""


@dataclass(frozen=True)
class TimelineRow:
    """A pass, over the frames that are kept.

    Attributes
    ----------
    name : str
    median_ms, p95_ms : float
        Medians of passes do not add up to that of the whole frame.
    share : float
        Share of the time of all passes, in [0, 1].
    """

    name: str
    median_ms: float
    p95_ms: float
    share: float


class Timeline:
    """Keeps the passes of the last `MOST_FRAMES` view frames that were recorded.

    One that a frame lacks took no time in it.
    """

    def __init__(self) -> None:
        self._frames: deque[tuple[int, dict[str, float], float]] = deque(maxlen=MOST_FRAMES)

    def add(self, shown: Shown) -> bool:
        """Take a picture's times; whether it has any, of another view frame than before."""
        if not shown.passes or (self._frames and self._frames[-1][0] == shown.step):
            return False
        times = {entry.name: entry.ms for entry in shown.passes}
        self._frames.append((shown.step, times, 1e3 * shown.seconds))
        return True

    @property
    def steps(self) -> NDArray[np.int64]:
        """(N,) the view frames that are kept, by `Shown.step`, in order."""
        return np.array([step for step, _, _ in self._frames], np.int64)

    @property
    def wall_ms(self) -> NDArray[np.float64]:
        """(N,) what the frames took from beginning to end, compiling included."""
        return np.array([wall for _, _, wall in self._frames], np.float64)

    def series(self) -> dict[str, NDArray[np.float64]]:
        """(N,) milliseconds by pass, in the order in which the passes first ran."""
        names = list(dict.fromkeys(name for _, times, _ in self._frames for name in times))
        values = [[times.get(name, 0.0) for name in names] for _, times, _ in self._frames]
        columns = np.array(values, np.float64).reshape(len(values), len(names)).T
        return dict(zip(names, columns, strict=True))

    def table(self) -> list[TimelineRow]:
        """A row of the whole frame, and one per pass, the longest first; none before a frame."""
        series = self.series()
        if not series:
            return []
        whole = np.sum(list(series.values()), axis=0)
        total = max(float(whole.sum()), 1e-12)
        rows = [
            TimelineRow(
                name,
                float(np.median(values)),
                float(np.percentile(values, 95)),
                float(values.sum()) / total,
            )
            for name, values in {WHOLE: whole, **series}.items()
        ]
        return [rows[0], *sorted(rows[1:], key=lambda row: -row.share)]
