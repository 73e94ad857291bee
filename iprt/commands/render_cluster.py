"""`iprt render --cluster`: a video whose chunks are rendered by workers of dask."""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING

import iprt
from iprt.commands.cluster_progress import cluster_progress
from iprt.commands.join import MOST_NAMED, join_chunks, whole_film
from iprt.commands.render_flags import RenderFlags
from iprt.commands.render_job import RenderJob
from iprt.commands.render_video import GOES_ON, expected_metadata
from iprt.commands.render_words import render_words, write_settings
from iprt.errors import IprtError
from iprt.farm.cluster import connected, local_devices, require_dask, scheduler_address
from iprt.farm.dispatch import SETTLE_S, Dispatch
from iprt.farm.order import Order
from iprt.files.lock import locked
from iprt.files.message_text import counted
from iprt.files.termination import at_termination
from iprt.film import view_at
from iprt.output.chunks import chunk_ranges, fade
from iprt.output.film_output import FilmOutput
from iprt.output.film_plan import FilmPlan
from iprt.output.frames import is_pattern
from iprt.output.movie import PIECE_S
from iprt.output.parts import parts_of

if TYPE_CHECKING:
    from distributed import Client

LOG = logging.getLogger("iprt.render")
START_S = 300.0
"""Longest time from the start of a process to its first frame: drivers may compile first."""


def render_on_cluster(
    job: RenderJob,
    plan: FilmPlan,
    flags: RenderFlags,
    where: str,
    numbers: Sequence[int] | None = None,
) -> bool:
    """Render the missing frames of a video on a cluster; return whether there were any.

    Finished frames are kept after an error or a signal, with a note of their number.

    Parameters
    ----------
    where : str
        The cluster, see `iprt render`.
    numbers : sequence of int or None
        Render these chunks alone, and leave the film unfinished. None: render all, and finish it.

    Raises
    ------
    IprtError
    """
    address = scheduler_address(where)
    require_dask()
    chosen = plan.chunks.numbers if numbers is None else numbers
    expected = expected_metadata(job, plan)

    def output_of(some: Sequence[int]) -> FilmOutput:
        """Return chunks as their files are now."""
        return FilmOutput(job.output, plan, some, expected)

    # The lock is shared with the renders of chunks; it keeps others out of the folder.
    with locked(job.output.parent, shared=True):
        target = output_of(chosen)
        chunks = {number: output_of([number]) for number in chosen if target.missing(number)}
        if chunks:
            if target.done:
                LOG.info(
                    "%s: continuing after %d of %d frames", job.output, target.done, target.total
                )
            devices = []
            if address is None:  # each worker has its own
                devices, flags = local_devices(where, flags.device), replace(flags, device=None)
            order = _order(job, plan, flags)
            _dispatch(job, order, output_of, target, chunks, connected(address, devices))
    if numbers is None:
        _join(job, plan)
    return bool(chunks)


def _join(job: RenderJob, plan: FilmPlan) -> None:
    """Make the film of its chunks, once files that other machines have written are seen here."""
    until = time.monotonic() + SETTLE_S
    while not whole_film(job.output, plan).complete:
        if time.monotonic() > until:
            break  # the error names the missing chunks
        time.sleep(1.0)
    join_chunks(job.output, plan)


def _dispatch(
    job: RenderJob,
    order: Order,
    output_of: Callable[[Sequence[int]], FilmOutput],
    target: FilmOutput,
    chunks: dict[int, FilmOutput],
    connection: AbstractContextManager[Client],
) -> None:
    """Render chunks, and tell the progress.

    Raises
    ------
    IprtError
        Chunks failed, no worker can render, or the scheduler is lost.
    """

    def kept() -> str | None:
        done = output_of(target.numbers).done
        return f"{done} of {counted(target.total, 'frame')} finished; {GOES_ON}" if done else None

    others = target.done - sum(chunk.done for chunk in chunks.values())
    try:
        with (
            at_termination(kept),
            cluster_progress(target.total, target.done, job.progress) as show,
            connection as client,
        ):
            dispatch = Dispatch(
                client,
                order,
                {number: (chunk.total, chunk.done) for number, chunk in chunks.items()},
                lambda number: output_of([number]).complete,
                lambda now: show(others + now.done, tuple(now.workers.values())),
            )
            dispatch.run()
            if dispatch.failed:
                raise IprtError(f"{job.output}: {_failures(dispatch.failed)}")
    except IprtError as error:
        if note := kept():
            error.add_note(note)
        raise


def _failures(failed: dict[int, str]) -> str:
    """Return in words which chunks failed, and why."""
    named = sorted(failed)[:MOST_NAMED]
    reasons = "; ".join(f"chunk {number}: {failed[number]}" for number in named)
    more = "" if len(failed) <= MOST_NAMED else f"; and {len(failed) - MOST_NAMED} more"
    return (
        f"{counted(len(failed), 'chunk')} failed ({chunk_ranges(tuple(sorted(failed)))}): "
        f"{reasons}{more}"
    )


def _order(job: RenderJob, plan: FilmPlan, flags: RenderFlags) -> Order:
    """Return the order, whose settings are written to the folder of parts."""
    root = job.scene.root.absolute()
    return Order(
        words=tuple(render_words(root, flags, write_settings(job))),
        scene=str(root),
        allow_outside=flags.allow_outside,
        fingerprint=plan.identity["iprt:files"],
        parts=str(parts_of(job.output).absolute()),
        device=flags.device,
        space=_space(job, plan),
        version=iprt.__version__,
        topic=f"iprt-{uuid.uuid4().hex}",
        patience_s=flags.frame_limit + START_S,
    )


def _space(job: RenderJob, plan: FilmPlan) -> int:
    """Return about the most bytes that one chunk has in files before its pieces are encoded."""
    view = view_at(job.scene, job.view, job.frames[0])
    pixels = view.width * view.height
    sides = 2 * fade(plan.chunks.warm_up) * pixels * 3 * 2
    waiting = plan.chunks.length if is_pattern(job.output) else round(PIECE_S * plan.rate)
    return sides + waiting * pixels * 3
