"""Times of a client's last view frames by pass."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.session import Shown

MOST_FRAMES = 200
WHOLE = "frame"
"""Name of the sum of all passes."""


@dataclass(frozen=True)
class PassStatistics:
    """Statistics of a pass over the recorded frames.

    Attributes
    ----------
    name : str
    mean_ms, p95_ms : float
        Mean, which adds up over passes to the frame's, and 95th percentile.
    share : float
        Fraction of the time of all passes.
    """

    name: str
    mean_ms: float
    p95_ms: float
    share: float


class PassTimes:
    """A record of the passes of the last `MOST_FRAMES` profiled view frames.

    A pass that a frame lacks counts as zero time.
    """

    def __init__(self) -> None:
        self._frames: deque[tuple[int, dict[str, float], float]] = deque(maxlen=MOST_FRAMES)

    def add(self, shown: Shown) -> bool:
        """Add a picture's times; return True if it has times of a new view frame."""
        if not shown.passes or (self._frames and self._frames[-1][0] == shown.step):
            return False
        times = {entry.name: entry.ms for entry in shown.passes}
        self._frames.append((shown.step, times, 1e3 * shown.seconds))
        return True

    @property
    def steps(self) -> NDArray[np.int64]:
        """(N,) recorded view frames, by `Shown.step`, in order."""
        return np.array([step for step, _, _ in self._frames], np.int64)

    @property
    def wall_ms(self) -> NDArray[np.float64]:
        """(N,) total times of the frames, including compilation."""
        return np.array([wall for _, _, wall in self._frames], np.float64)

    @property
    def top_ms(self) -> float:
        """Upper end of a plot of the passes' sums, above which only rare spikes are cut off."""
        sums = np.sum(list(self.series().values()), axis=0)
        return max(1.1 * float(min(np.max(sums), 2.0 * np.percentile(sums, 90))), 1e-3)

    def series(self) -> dict[str, NDArray[np.float64]]:
        """Return (N,) milliseconds by pass, in the order in which the passes first ran."""
        names = list(dict.fromkeys(name for _, times, _ in self._frames for name in times))
        values = [[times.get(name, 0.0) for name in names] for _, times, _ in self._frames]
        columns = np.array(values, np.float64).reshape(len(values), len(names)).T
        return dict(zip(names, columns, strict=True))

    def table(self) -> list[PassStatistics]:
        """Return a row for the frame and one per pass, longest first; none without frames."""
        series = self.series()
        if not series:
            return []
        whole = np.sum(list(series.values()), axis=0)
        total = max(float(whole.sum()), 1e-12)
        rows = [
            PassStatistics(
                name,
                float(np.mean(values)),
                float(np.percentile(values, 95)),
                float(values.sum()) / total,
            )
            for name, values in {WHOLE: whole, **series}.items()
        ]
        return [rows[0], *sorted(rows[1:], key=lambda row: -row.share)]
