"""Time to accuracy of several renderers, each in a process of its own, on the same cores."""

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
from iprt.measure.convergence import Curve, curve
from iprt.measure.timed_renderers import Entry, Subject
from iprt.measure.view_truth import Radiance, Scores, Target

Picture = tuple[float, Radiance]
"""Seconds and linear radiance; see `TimedRenderer.picture`."""
QUICK_S, TRIES = 4.0, 3
"""Pictures made in less are made so often, and the median time counts: little disturbs them."""


@dataclass(frozen=True)
class Result:
    """How one renderer did on a view.

    Attributes
    ----------
    once : float
        Seconds from the start of its process to its first picture, of one frame or one sample per
        pixel, less those of a second such picture.
    curve : Curve
        Accuracy against seconds per picture, of what is in memory after the first one.
    color : (H, W, 3) float32
        Its last picture, linear.
    """

    once: float
    curve: Curve
    color: Radiance

    def record(self) -> dict[str, object]:
        """All but the picture as plain data."""
        return {"once": self.once, **self.curve.record()}


class RendererProcess:
    """A renderer in a process of its own, which is warm.

    Attributes
    ----------
    once : float
        See `Result`.
    """

    def __init__(self, label: str, pipe: Connection, start: float) -> None:
        """`start`: when its process was started, by `time.perf_counter`."""
        self.label, self._pipe = label, pipe
        self._receive()
        first = time.perf_counter() - start
        self.once = first - self.picture(1, 0)[0]

    def picture(self, count: int, seed: int) -> Picture:
        """See `TimedRenderer.picture`.

        Raises
        ------
        IprtError
            As it was raised there; or the process has ended.
        """
        self._pipe.send((count, seed))
        picture = self._receive()
        assert picture is not None
        return picture

    def _receive(self) -> Picture | None:
        """A picture; None: the renderer is ready."""
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
def renderer_process(entry: Entry, subject: Subject) -> Iterator[RendererProcess]:
    """Start a renderer's process, and end it after the block."""
    # It lets signals through when it starts, which `end_on_signals` keeps from all threads.
    kept = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    resource_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_SETMASK, kept)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, entry, subject), daemon=True)
    start = time.perf_counter()
    process.start()
    theirs.close()  # or its end would go unnoticed
    # Signals are kept from the process too.
    with ours, at_termination(process.kill):
        try:
            yield RendererProcess(entry.label, ours, start)
        finally:
            process.kill()
            process.join()


def _serve(pipe: Connection, entry: Entry, subject: Subject) -> None:
    """What the process does: pictures that are asked for, until nobody is there."""
    try:
        renderer = entry.renderer(subject)
        renderer.prepare(0)
        pipe.send(None)
        while True:
            pipe.send(renderer.picture(*pipe.recv()))
    except EOFError:
        pass
    except IprtError as error:
        pipe.send(error)


def run_race(
    subjects: Sequence[Subject],
    entries: Sequence[Entry],
    counts: Sequence[int],
    *,
    enough: float,
    seeds: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[tuple[Target, list[Result]]]:
    """The results of each view, in the order of `entries`.

    Renderers take turns picture by picture, so that what slows the machine down slows all.

    Parameters
    ----------
    counts : sequence of int
        Frames of iprt, samples per pixel of the others; rising.
    enough : float
        A renderer whose SSIM is so high in all cuts is not asked for more.
    seeds : int
        Pictures per count that scores and times are the means of.
    progress : callable, optional
        Called with the number of pictures made so far; those not asked for count.
    """
    done = 0
    for subject in subjects:
        with ExitStack() as stack:
            processes = [stack.enter_context(renderer_process(entry, subject)) for entry in entries]
            tracks = [Track(counts, enough) for _ in processes]
            for seed in range(seeds):
                for count in counts:
                    for process, track in zip(processes, tracks, strict=True):
                        if count in track.counts:
                            seconds, color = _timed(process, count, seed)
                            what = f"{process.label}, {count}"
                            track.add(seed, seconds, scored(subject.target, color, what), color)
                        done += 1
                        if progress is not None:
                            progress(done)
        yield (
            subject.target,
            [
                track.result(subject.target.name, process.label, process.once)
                for process, track in zip(processes, tracks, strict=True)
            ],
        )


def _timed(process: RendererProcess, count: int, seed: int) -> Picture:
    """A picture and the seconds that it took; it is the same each time."""
    seconds, color = process.picture(count, seed)
    if seconds < QUICK_S:
        seconds = median([seconds, *(process.picture(count, seed)[0] for _ in range(TRIES - 1))])
    return seconds, color


class Track:
    """The pictures of one renderer.

    Attributes
    ----------
    counts : sequence of int
        Those worth asking for; they end where the first seed's pictures are good enough.
    """

    def __init__(self, counts: Sequence[int], enough: float) -> None:
        self.counts = list(counts)
        self._enough = enough
        self._runs: list[list[tuple[float, Scores]]] = []

    def add(self, seed: int, seconds: float, scores: Scores, color: Radiance) -> None:
        """The picture of the next of `counts`, for the first seed, and then for the others."""
        if seed == len(self._runs):
            self._runs.append([])
        run = self._runs[seed]
        run.append((seconds, scores))
        self._color = color
        if seed == 0 and min(scores.ssim_cuts or (scores.ssim,)) >= self._enough:
            del self.counts[len(run) :]

    def result(self, view: str, label: str, once: float) -> Result:
        """All pictures together; there is at least one."""
        return Result(once, curve(view, label, self.counts, self._runs), self._color)
