"""Time to accuracy of several renderers, each in its own process, on the same cores."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from statistics import median

from iprt.errors import IprtError
from iprt.files.termination import at_termination
from iprt.measure.compare import scored
from iprt.measure.convergence_curves import Curve, curve
from iprt.measure.timed_renderers import RacedRenderer, RacedView
from iprt.measure.view_truth import Radiance, Scores, Target

Picture = tuple[float, Radiance]
"""Seconds and linear radiance; see `TimedRenderer.picture`."""
QUICK_S, TRIES = 4.0, 3
"""Pictures that take less than `QUICK_S` are rendered `TRIES` times for a median time."""


@dataclass(frozen=True)
class RaceResult:
    """RaceResult of one renderer on a view.

    Attributes
    ----------
    once : float
        One-time cost: seconds from the start of the process to the first picture (one frame or one
        sample per pixel), minus the seconds of a second such picture.
    curve : Curve
        Accuracy against seconds per picture, with the scene in memory.
    """

    once: float
    curve: Curve


class RendererProcess:
    """A warmed-up renderer in its own process.

    Attributes
    ----------
    once : float
        One-time cost; see `RaceResult`.
    """

    def __init__(self, label: str, pipe: Connection, start: float) -> None:
        """Wait for the renderer and time its first pictures.

        `start` is the `time.perf_counter` of the process's start.
        """
        self.label, self._pipe = label, pipe
        self._receive()
        first = time.perf_counter() - start
        self.once = first - self.picture(1, 0)[0]

    def picture(self, count: int, seed: int) -> Picture:
        """Render a picture; see `TimedRenderer.picture`.

        Raises
        ------
        IprtError
            The renderer raised it, or the process has ended.
        """
        self._pipe.send((count, seed))
        picture = self._receive()
        assert picture is not None
        return picture

    def _receive(self) -> Picture | None:
        """Receive a picture, or None once the renderer is ready."""
        try:
            answer: Picture | IprtError | None = self._pipe.recv()
        except EOFError:
            raise IprtError(
                f"{self.label}: its process has ended early; was there enough memory?"
            ) from None
        if isinstance(answer, IprtError):
            raise answer
        return answer


@contextmanager
def renderer_process(raced: RacedRenderer, view: RacedView) -> Iterator[RendererProcess]:
    """Start a renderer's process, and end it after the `with` block."""
    # Starting the resource tracker unblocks signals that `end_on_signals` blocks in all threads.
    kept = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    resource_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_SETMASK, kept)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, raced, view), daemon=True)
    start = time.perf_counter()
    process.start()
    theirs.close()  # else the end of the process would not close the pipe
    # The process inherits the blocked signals, so it must be killed explicitly.
    with ours, at_termination(process.kill):
        try:
            yield RendererProcess(raced.label, ours, start)
        finally:
            process.kill()
            process.join()


def _serve(pipe: Connection, raced: RacedRenderer, view: RacedView) -> None:
    """Render requested pictures until the pipe is closed."""
    try:
        renderer = raced.load(view)
        renderer.prepare(0)
        pipe.send(None)
        while True:
            pipe.send(renderer.picture(*pipe.recv()))
    except EOFError:
        pass
    except IprtError as error:
        pipe.send(error)


def run_race(
    views: Sequence[RacedView],
    renderers: Sequence[RacedRenderer],
    counts: Sequence[int],
    *,
    enough: float,
    seeds: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[tuple[list[RaceResult], Target, list[Radiance]]]:
    """Measure all renderers on each view; yield results with the last pictures, linear.

    Renderers are interleaved picture by picture, so that a slowdown of the machine affects all.

    Parameters
    ----------
    counts : sequence of int
        Frames of iprt, or samples per pixel of the others, rising.
    enough : float
        SSIM in all cuts at which a renderer stops.
    seeds : int
        Number of pictures per count to average.
    progress : callable, optional
        Called with the number of pictures done so far, including skipped ones.
    """
    done = 0
    for view in views:
        target = view.target
        with ExitStack() as stack:
            processes = [stack.enter_context(renderer_process(raced, view)) for raced in renderers]
            tracks = [Track(counts, enough) for _ in processes]
            for seed in range(seeds):
                for count in counts:
                    for process, track in zip(processes, tracks, strict=True):
                        if count in track.counts:
                            seconds, color = _timed(process, count, seed)
                            what = f"{process.label}, {count}"
                            track.add(seed, seconds, scored(target, color, what), color)
                        done += 1
                        if progress is not None:
                            progress(done)
        results = [
            RaceResult(process.once, track.curve(target.name, process.label))
            for process, track in zip(processes, tracks, strict=True)
        ]
        yield results, target, [track.color for track in tracks]


def _timed(process: RendererProcess, count: int, seed: int) -> Picture:
    """Render a picture, and repeat a quick one for its median time."""
    seconds, color = process.picture(count, seed)
    if seconds < QUICK_S:
        seconds = median([seconds, *(process.picture(count, seed)[0] for _ in range(TRIES - 1))])
    return seconds, color


class Track:
    """Scores of one renderer's pictures.

    Attributes
    ----------
    counts : list of int
        Counts to render, up to the first one that is accurate enough for the first seed.
    color : (H, W, 3) float32
        Linear radiance of the last picture.
    """

    color: Radiance

    def __init__(self, counts: Sequence[int], enough: float) -> None:
        self.counts = list(counts)
        self._enough = enough
        self._runs: list[list[tuple[float, Scores]]] = []

    def add(self, seed: int, seconds: float, scores: Scores, color: Radiance) -> None:
        """Add the picture of the next of `counts`. Seeds follow each other."""
        if seed == len(self._runs):
            self._runs.append([])
        run = self._runs[seed]
        run.append((seconds, scores))
        self.color = color
        if seed == 0 and min(scores.cuts) >= self._enough:
            del self.counts[len(run) :]

    def curve(self, view: str, label: str) -> Curve:
        """Combine all pictures, at least one."""
        return curve(view, label, self.counts, self._runs)
