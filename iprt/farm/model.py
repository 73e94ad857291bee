"""Forecast of the time that a film takes on a farm, by a simulation of its tasks.

A task is one chunk. A worker asks the scheduler for it, starts, renders the warm-up and the frames,
and passes its bytes through the storage, which serves one task after another. Workers differ in
speed, and die: then the chunk is repeated from its start. The join follows the last chunk.
"""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from statistics import mean

SEEDS = range(3)
"""Simulations whose mean counts."""
NEAR = 1.03
"""The longest chunk counts as the best whose time is so near to the least."""
HOUR_S = 3600.0


@dataclass(frozen=True)
class FilmCost:
    """Cost of a film.

    Attributes
    ----------
    frames : int
    warm_up : int
        Frames that each chunk renders besides its own.
    frame_s : float
        Seconds of a frame on a worker of usual speed.
    frame_bytes, chunk_bytes : float
        Bytes that a frame, and the fade at a chunk's start, bring through the storage.
    join_s : float
        Seconds of the join.
    """

    frames: int
    warm_up: int
    frame_s: float
    frame_bytes: float = 0.0
    chunk_bytes: float = 0.0
    join_s: float = 0.0


@dataclass(frozen=True)
class Farm:
    """Machines that render a film.

    Attributes
    ----------
    workers : int
    start_s : float
        Seconds from the start of a task to its first frame.
    task_s : float
        Seconds of the scheduler for each task, one after another.
    storage : float
        Bytes a second that the storage reads and writes for all workers together.
    spread : float
        Standard deviation of the logarithm of the workers' seconds per frame.
    deaths : float
        Deaths of a worker per hour.
    lost_s : float
        Seconds until a dead worker is noticed and replaced.
    """

    workers: int
    start_s: float = 0.0
    task_s: float = 0.0
    storage: float = math.inf
    spread: float = 0.0
    deaths: float = 0.0
    lost_s: float = 0.0


@dataclass(frozen=True)
class Forecast:
    """Time of a film.

    Attributes
    ----------
    chunk : int
        Frames of a chunk.
    seconds : float
    limits : mapping of str to float
        Shortest time that each part of the farm allows, seconds.
    repeats : float
        Tasks that were begun again.
    """

    chunk: int
    seconds: float
    limits: Mapping[str, float]
    repeats: float

    @property
    def limit(self) -> str:
        """The part of the farm that limits the film most."""
        return max(self.limits, key=self.limits.__getitem__)


def forecast(film: FilmCost, farm: Farm, chunk: int) -> Forecast:
    """Return the mean forecast of some simulations."""
    found = [_Simulation(film, farm, chunk, seed).run() for seed in SEEDS]
    seconds = mean(end for end, _ in found) + film.join_s
    repeats = mean(repeated for _, repeated in found)
    return Forecast(chunk, seconds, limits(film, farm, chunk), repeats)


def best_forecast(film: FilmCost, farm: Farm, chunks: Sequence[int]) -> Forecast:
    """Return the forecast with the longest of `chunks` whose time is near the least."""
    found = [forecast(film, farm, chunk) for chunk in chunks]
    most = NEAR * min(one.seconds for one in found)
    return max((one for one in found if one.seconds <= most), key=lambda one: one.chunk)


def limits(film: FilmCost, farm: Farm, chunk: int) -> dict[str, float]:
    """Return the shortest time that each part of the farm allows, seconds."""
    count = -(-film.frames // chunk)
    frames = film.frames + count * film.warm_up
    return {
        "workers": (frames * film.frame_s + count * farm.start_s) / farm.workers,
        "chunk": farm.start_s + (min(chunk, film.frames) + film.warm_up) * film.frame_s,
        "scheduler": count * farm.task_s,
        "storage": (frames * film.frame_bytes + count * film.chunk_bytes) / farm.storage,
        "join": film.join_s,
    }


class _Simulation:
    """Events of a film on a farm, by their times."""

    def __init__(self, film: FilmCost, farm: Farm, chunk: int, seed: int) -> None:
        self._film, self._farm = film, farm
        self._random = random.Random(seed)
        starts = range(0, film.frames, chunk)
        self._waiting = deque(min(chunk, film.frames - start) for start in starts)
        # The mean speed is 1, whatever the spread.
        self._slowness = [
            math.exp(self._random.gauss(farm.spread**2 / 2.0, farm.spread))
            for _ in range(farm.workers)
        ]
        # Time, worker, frames of the task that it has rendered (if negative: lost), and the time
        # of its death.
        self._events: list[tuple[float, int, int, float]] = [
            (0.0, worker, 0, math.inf) for worker in range(farm.workers)
        ]
        heapify(self._events)
        self._scheduler = self._storage = self._end = 0.0
        self._repeats = 0

    def run(self) -> tuple[float, int]:
        """Return the end of the last task and the number of repeated ones."""
        while self._events:
            now, worker, frames, death = heappop(self._events)
            if frames > 0:
                self._store(now, worker, frames, death)
                continue
            if frames < 0:
                self._waiting.appendleft(-frames)
            if self._waiting:
                self._begin(now, worker)
        return self._end, self._repeats

    def _begin(self, now: float, worker: int) -> None:
        film, farm = self._film, self._farm
        self._scheduler = max(self._scheduler, now) + farm.task_s
        begun, frames = self._scheduler, self._waiting.popleft()
        rendering = (frames + film.warm_up) * film.frame_s * self._slowness[worker]
        end = begun + farm.start_s + rendering
        death = math.inf
        if farm.deaths > 0.0:
            death = begun + self._random.expovariate(farm.deaths / HOUR_S)
        if death < end:
            self._lose(death, worker, frames)
        else:
            heappush(self._events, (end, worker, frames, death))

    def _store(self, now: float, worker: int, frames: int, death: float) -> None:
        film, farm = self._film, self._farm
        amount = (frames + film.warm_up) * film.frame_bytes + film.chunk_bytes
        end = max(self._storage, now) + amount / farm.storage
        if death < end:
            self._lose(max(death, now), worker, frames)
            return
        self._storage, self._end = end, max(self._end, end)
        heappush(self._events, (end, worker, 0, math.inf))

    def _lose(self, death: float, worker: int, frames: int) -> None:
        """Begin a task again once the worker's death is noticed, on the one that replaces it."""
        self._repeats += 1
        heappush(self._events, (death + self._farm.lost_s, worker, -frames, math.inf))
