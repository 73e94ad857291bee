"""`iprt farm`: films for the schedulers of farms, and a forecast of their time."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.commands.render_flags import Flags, RenderFlags
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.commands.render_job import RenderJob
    from iprt.farm.model import FilmCost
    from iprt.farm.submission import Submission

MINUTES = 20.0
"""Default time of a task: long beside its start, and short beside a night."""
MOST = 100_000
"""Most workers of a forecast."""


def openjd(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    flags: Flags,
    gpus: int | None = None,
    minutes: float = MINUTES,
    seconds_per_frame: float | None = None,
) -> int:
    """Print a job template (Open Job Description) that renders a film on a farm.

    The template has a step for the chunks that are missing, and one that makes the film of them.
    The settings go to the folder of the film's parts.

    Parameters
    ----------
    scene
        Scene folder.
    flags
        The film, its settings, and its files.
    gpus
        GPUs of a worker that one task takes. Default: 1, or 0 with --device cpu.
    minutes
        Time that a task is meant to take; the farm puts as many chunks into it.
    seconds_per_frame
        Time of a frame on a worker, from which the first tasks get their size. Default: their size
        is one chunk.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.farm.openjd import require_words, template

    film = _submission(scene, flags, gpus, minutes, seconds_per_frame, require_words)
    _write(template(film).encode())
    return 0


def slurm(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    flags: Flags,
    gpus: int | None = None,
    minutes: float = MINUTES,
    seconds_per_frame: float | None = None,
    at_once: int | None = None,
) -> int:
    """Print a script that renders a film on a cluster with SLURM.

    The script submits an array job for the chunks that are missing, and a job that makes the film
    of them. The settings go to the folder of the film's parts.

    Parameters
    ----------
    scene
        Scene folder.
    flags
        The film, its settings, and its files.
    gpus
        GPUs of a node that one task takes. Default: 1, or 0 with --device cpu.
    minutes
        Time that a task is meant to take, if --seconds-per-frame is given.
    seconds_per_frame
        Time of a frame on a node, from which tasks get their size and their time limit. Default:
        their size is one chunk, or as many as an array of 1000 tasks needs; they get the time limit
        of the cluster.
    at_once
        Most tasks that run at the same time.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.farm.slurm import script
    from iprt.farm.submission import require_words

    if at_once is not None and at_once < 1:
        raise IprtError(f"--at-once {at_once}: expected a number above 0")
    film = _submission(scene, flags, gpus, minutes, seconds_per_frame, require_words)
    _write(os.fsencode(script(film, at_once)))
    return 0


def plan(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    flags: Flags,
    seconds_per_frame: float,
    workers: str = "1,10,100,1000",
    start_seconds: float = 5.0,
    storage: float = 1.0,
    deaths_per_hour: float = 0.01,
    markdown: bool = False,
) -> int:
    """Forecast the time of a film on a farm, what limits it, and the best length of a chunk.

    A simulation, with one chunk in a task. It also assumes that workers differ by a tenth in speed,
    and that a dead one is noticed and replaced after two minutes.

    Parameters
    ----------
    scene
        Scene folder.
    flags
        The film, its settings, and its files.
    seconds_per_frame
        Time of a frame on a worker, with its encoding.
    workers
        Numbers of workers, separated by commas.
    start_seconds
        Time from the start of a task to its first frame.
    storage
        Gigabytes a second that the shared storage reads and writes for all workers together.
    deaths_per_hour
        How often a worker dies.
    markdown
        Print a Markdown table.

    Returns
    -------
    int
        Exit status 0.
    """
    counts = _counts(workers)
    _require_positive("--seconds-per-frame", seconds_per_frame)
    _require_positive("--storage", storage)
    for flag, value in (("start-seconds", start_seconds), ("deaths-per-hour", deaths_per_hour)):
        if not 0.0 <= value < float("inf"):
            raise IprtError(f"--{flag} {value:g}: expected 0 or more")
    _require_film(flags)
    job = flags.job(scene)

    from iprt.commands.render_video import film_plan
    from iprt.farm.model import Farm
    from iprt.farm.plan import DEAD_S, SPREAD, TASK_S, grid
    from iprt.output.grid import print_grid

    chunks = film_plan(job).chunks
    farm = Farm(1, start_seconds, TASK_S, 1e9 * storage, SPREAD, deaths_per_hour, DEAD_S)
    cost = _cost(job, chunks.warm_up, seconds_per_frame)
    print_grid(grid(cost, farm, counts, chunks.length), markdown=markdown)
    return 0


def _cost(job: RenderJob, warm_up: int, frame_s: float) -> FilmCost:
    """Return the cost of a film for a farm."""
    from iprt.farm.model import FilmCost
    from iprt.farm.plan import FULL, HALF, JOIN_S, fade_bytes, movie_bytes
    from iprt.film import view_at
    from iprt.output.encode import CODECS
    from iprt.output.frames import is_pattern
    from iprt.scene.scene_files import input_files

    view = view_at(job.scene, job.view, job.frames[0])
    pixels, layers = view.width * view.height, 1 + len(job.aovs)
    exr, separate = job.output.suffix.lower() == ".exr", is_pattern(job.output)
    if separate:
        written = 3.0 * pixels * (FULL * layers if exr else 1)
    else:
        written = movie_bytes(pixels, CODECS[job.codec].bits)
    sizes = sum(path.stat().st_size for path in input_files(job.scene) if path.exists())
    return FilmCost(
        frames=len(job.frames),
        warm_up=warm_up,
        frame_s=frame_s,
        frame_bytes=written + sizes / len(job.scene.frame_indices),
        chunk_bytes=fade_bytes(pixels, warm_up, FULL if exr else HALF, layers),
        join_s=0.0 if separate else JOIN_S * len(job.frames),
    )


def _write(text: bytes) -> None:
    """Write to stdout: a shell needs the names' own bytes, and YAML is UTF-8 everywhere."""
    sys.stdout.flush()
    sys.stdout.buffer.write(text)


def _counts(text: str) -> list[int]:
    """Parse the value of `--workers`."""
    words = [word.strip() for word in text.split(",")]
    if not all(word.isascii() and word.isdigit() and 0 < int(word) <= MOST for word in words):
        raise IprtError(f"--workers {text}: expected numbers from 1 to {MOST}, such as 1,10,100")
    return [int(word) for word in words]


def _submission(
    scene: Path,
    flags: RenderFlags,
    gpus: int | None,
    minutes: float,
    frame_s: float | None,
    require_words: Callable[[Iterable[str]], None],
) -> Submission:
    """Check everything and write the settings; return the submission to a scheduler."""
    _require_positive("--minutes", minutes)
    _require_positive("--seconds-per-frame", frame_s)
    if gpus is not None and gpus < 0:
        raise IprtError(f"--gpus {gpus}: expected 0 or more")
    _require_film(flags)
    job = flags.job(scene)

    from iprt.commands.render_video import expected_metadata, film_plan
    from iprt.commands.render_words import SETTINGS, render_words, write_settings
    from iprt.farm.submission import Submission, iprt
    from iprt.files.lock import locked
    from iprt.output.film_output import FilmOutput
    from iprt.output.parts import parts_of

    output = job.output.absolute()
    words = render_words(scene, flags, parts_of(output) / SETTINGS)
    require_words((*words, iprt()))
    plan = film_plan(job)
    with locked(output.parent, shared=True):
        target = FilmOutput(output, plan, plan.chunks.numbers, expected_metadata(job, plan))
        missing = tuple(number for number in target.numbers if target.missing(number))
        if not missing:
            raise IprtError(f"{job.output}: no frame is missing; iprt join makes the film of them")
        write_settings(job)
    return Submission(
        output=output,
        words=words,
        numbers=missing,
        chunk=plan.chunks.length + plan.chunks.warm_up,
        gpus=(0 if flags.device == "cpu" else 1) if gpus is None else gpus,
        target_s=60.0 * minutes,
        frame_s=frame_s,
    )


def _require_film(flags: RenderFlags) -> None:
    if not flags.video:
        raise IprtError(
            f"{flags.output}: is a still picture; farms render films, such as film.mp4 or "
            "frame.%04d.png"
        )


def _require_positive(flag: str, value: float | None) -> None:
    if value is not None and not 0.0 < value < float("inf"):
        raise IprtError(f"{flag} {value:g}: expected a number above 0")
