"""Holds a target frame rate: goes down the ladder of `iprt.viewer.ladder`, and up again.

How much quicker one rung is than another was measured on some other device, of another scene. So it
is learned anew, whenever the rung changes, from the frames before and after. A rung that turned
out too slow is therefore not tried again, until frames take longer or shorter without a change.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean, median

from iprt.settings.model import Settings
from iprt.viewer.ladder import Ladder, Rung, measured_ladder, rungs_below

SKIPPED = 2
"""Frames after a change that do not count: buffers are made, histories and caches begin."""
FEWEST = 4
"""Frames that tell of a rung; as many of the newest have to agree that it is too slow."""
WINDOW, MEMORY = 16, 64
"""Frames that are averaged before going down, and, if there are so many, before going up."""
OUTLIER = 3.0
"""A frame counts as so many times the median at most: some only waited for something else."""
STEP = 1.5
"""Factor between frames before and after a change of the load that is seen at once."""
TOO_SLOW, ALL_TOO_SLOW = 1.1, 1.05
"""Means of the newest frames and of the window, over the time of a frame, at which to go down."""
ROOM_DOWN, ROOM_UP = 0.9, 0.8
"""Share of the time of a frame that the rung may take to which one goes down, or up."""
UP_S, TURN_S = 2.0, 1.0
"""Seconds on a rung before going up, and before going back where one came from."""
PATIENCE_S = 30.0
"""Seconds on a rung after which what was learned of better ones is doubted: the load may have been
another just as the rung changed. Twice as long each time."""
OTHER_LOAD = 1.5
"""Factor between times of a rung now and when it was new at which what was learned is forgotten."""


class Pace:
    """Chooses settings and resolution by how long frames take.

    Parameters
    ----------
    target_fps : float
        Frames per second to hold; above 0.
    base : Settings
        What the user asked for: the best that is chosen. If he asks for something else, make
        another `Pace`.
    ladder : Ladder or None
        None: that of the package.
    usual_s : float or None
        Seconds that a frame takes as the user asked for it, if that is known: then it begins on
        the rung that this leads to.
    """

    def __init__(
        self,
        target_fps: float,
        base: Settings,
        ladder: Ladder | None = None,
        *,
        usual_s: float | None = None,
    ) -> None:
        self.base = base
        self.rungs: Sequence[Rung] = rungs_below(base, ladder or measured_ladder())
        self._target_s = 1.0 / target_fps
        self._now = 0
        self._factors: dict[int, float] = {}  # of the rungs that were stood on
        self._before: tuple[int, float] | None = None  # the rung before, and seconds of its frames
        self._went_up = False  # at the last change
        self._patience_s = PATIENCE_S
        self._times: list[float] = []  # of the frames that count since then
        self._usual_s: float | None = None  # their mean, once a window is full
        self._skip, self._stood_s = SKIPPED, 0.0
        if usual_s is not None and usual_s > TOO_SLOW * self._target_s:
            self._go(self._fitting(range(1, len(self.rungs)), usual_s), usual_s)

    @property
    def rung(self) -> Rung:
        """What is to be rendered now."""
        return self.rungs[self._now]

    def observe(self, seconds: float, compiled: bool) -> Rung:
        """Take note of a frame of the present rung.

        Parameters
        ----------
        seconds : float
            That it took.
        compiled : bool
            Kernels were compiled for it: then its time says nothing.

        Returns
        -------
        Rung
            What to render next: another object only if it changes.
        """
        if compiled:
            return self.rung
        self._stood_s += seconds
        if self._skip > 0:
            self._skip -= 1
            return self.rung
        self._times = [*self._times[1 - MEMORY :], seconds]
        if len(self._times) >= FEWEST:
            self._notice_step()
            self._learn(_mean(self._times))
            self._decide()
        return self.rung

    def _notice_step(self) -> None:
        """If the newest frames all differ from those before, the load is another now."""
        before, newest = self._times[:-FEWEST], self._times[-FEWEST:]
        if len(before) < FEWEST:
            return
        usual = median(before)
        if min(newest) > STEP * usual or max(newest) < usual / STEP:
            self._times = newest
            self._before = None

    def _learn(self, mean: float) -> None:
        """What a change made of a frame's time is the rung's doing, what comes later the load's."""
        full = len(self._times) >= WINDOW
        if self._before is not None:
            number, time = self._before
            self._factors[self._now] = self._factor(number) * mean / time
            if full:
                self._before = None
        elif self._usual_s is not None and _differ(mean, self._usual_s, OTHER_LOAD):
            # Other things are slow now: what was learned may hold no more.
            self._factors.clear()
            self._usual_s, self._patience_s = None, PATIENCE_S
        if full and self._usual_s is None:
            self._usual_s = mean

    def _factor(self, number: int) -> float:
        """Time on a rung relative to that on others: learned, or as the ladder has it.

        The ladder's is corrected by what was learned of the nearest rung.
        """
        if number in self._factors:
            return self._factors[number]
        share = self.rungs[number].share
        if not self._factors:
            return share
        nearest = min(self._factors, key=lambda n: abs(n - number))
        return share * self._factors[nearest] / self.rungs[nearest].share

    def _decide(self) -> None:
        target, now = self._target_s, self._now
        mean = _mean(self._times[-WINDOW:])
        newest = median(self._times[-FEWEST:])
        below = range(now + 1, len(self.rungs))
        if newest > TOO_SLOW * target and mean > ALL_TOO_SLOW * target:
            if below and (not self._went_up or self._stood_s >= TURN_S):
                # It was noise in part that led here: the longer mean is less so.
                self._go(self._fitting(below, mean), min(mean, _mean(self._times)))
        elif self._stood_s >= UP_S and len(self._times) >= WINDOW:
            mean = _mean(self._times)
            fits = [n for n in range(now) if self._expected(n, mean) <= ROOM_UP * target]
            if fits:
                self._go(fits[0], mean)
            elif self._stood_s >= self._patience_s:
                self._factors.clear()
                self._patience_s *= 2.0

    def _fitting(self, below: range, mean: float) -> int:
        """The first rung that holds the target, or else the quickest."""
        fits = [n for n in below if self._expected(n, mean) <= ROOM_DOWN * self._target_s]
        return fits[0] if fits else min(below, key=self._factor, default=self._now)

    def _expected(self, number: int, mean: float) -> float:
        """Seconds of a frame on a rung, if they are `mean` on the present one."""
        return mean * self._factor(number) / self._factor(self._now)

    def _go(self, number: int, mean: float) -> None:
        self._factors[self._now] = self._factor(self._now)
        self._before, self._went_up = (self._now, mean), number < self._now
        self._now = number
        self._times, self._usual_s = [], None
        self._skip, self._stood_s = SKIPPED, 0.0


def _mean(times: Sequence[float]) -> float:
    """The median of few frames, which one outlier among them does not move."""
    middle = median(times)
    if len(times) < WINDOW // 2:
        return middle
    return fmean(min(time, OUTLIER * middle) for time in times)


def _differ(a: float, b: float, factor: float) -> bool:
    return not 1.0 / factor < a / b < factor
