"""Chunks of a film given to the workers of a cluster, each until it is rendered.

A worker has one chunk at a time, which is bound to it: the client knows who has what, and gives a
chunk that failed to another worker. The files alone decide which chunks are finished.
"""

from __future__ import annotations

import bisect
import errno
import logging
import os
import queue
import time
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from iprt.errors import IprtError
from iprt.farm.crew import STRIKES, State, Worker, tagged
from iprt.farm.examine import examine
from iprt.farm.order import RESOURCE, Order, Outcome
from iprt.farm.task import LONGEST, render_chunk
from iprt.files.message_text import counted, printable

if TYPE_CHECKING:
    from distributed import Client, Future

LOG = logging.getLogger("iprt.render")
TRIES = 3
"""Times that a chunk is given to a worker before it counts as failed."""
POLL_S = 1.0
"""Time between two looks at the list of workers."""
ALONE_S = 30.0
"""Longest wait for a worker while there is none."""
SILENT_S = 60.0
"""Time without a sign after which a worker counts as hung, besides the time its render may take."""
RESULT_S = 10.0
"""Longest wait for the few bytes of a result; it takes milliseconds."""
SETTLE_S = 60.0
"""Time after which files of other machines are seen on every network file system."""
STORAGE = tuple(
    map(os.strerror, (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ESTALE))
)
"""Reasons of failed writes that another worker may not have."""
BAD_INPUT = IprtError.exit_code


class Dispatch:
    """Renders chunks on the workers of a cluster.

    Parameters
    ----------
    client : distributed.Client
    order : Order
    chunks : mapping of int to (int, int)
        Frames of each chunk, and how many of them were finished before, by its number.
    complete : callable
        Returns whether all files of a chunk are there, by its number.
    show : callable
        Called about twice a second, to show the progress.
    render, look : callable
        Tasks that render a chunk and examine a worker.

    Attributes
    ----------
    workers : dict of str to Worker
        By address.
    finished : set of int
        Chunks that are complete.
    failed : dict of int to str
        Why chunks are not, in one line.
    """

    def __init__(
        self,
        client: Client,
        order: Order,
        chunks: Mapping[int, tuple[int, int]],
        complete: Callable[[int], bool],
        show: Callable[[Dispatch], None] = lambda _: None,
        *,
        render: Callable[[Order, int], Outcome] = render_chunk,
        look: Callable[[Order, str], dict[str, str]] = examine,
    ) -> None:
        self._client, self._order = client, order
        self._totals = {number: total for number, (total, _) in chunks.items()}
        self._known = {number: done for number, (_, done) in chunks.items()}
        self._complete, self._show = complete, show
        self._render, self._look = render, look
        self.workers: dict[str, Worker] = {}
        self.finished: set[int] = set()
        self.failed: dict[int, str] = {}
        self._pending = sorted(chunks)
        self._tried: dict[int, list[str]] = {number: [] for number in chunks}
        self._news: queue.SimpleQueue[tuple[Worker, Future] | dict[str, Any]] = queue.SimpleQueue()
        self._unseen: dict[int, tuple[Worker, float]] = {}
        self._told: set[str] = set()
        self._token = f"cluster-{uuid.uuid4().hex}"
        self._looked = self._alone_since = -float("inf")

    @property
    def done(self) -> int:
        """Finished frames of the chunks, as far as workers have told."""
        return sum(self._known.values())

    def run(self) -> None:
        """Render all chunks that can be rendered.

        Raises
        ------
        IprtError
            No worker can render, or the scheduler is lost.
        """
        token = Path(self._order.parts) / self._token
        token.write_text("written by the client", "utf-8")
        self._alone_since = time.monotonic()
        self._client.subscribe_topic(self._order.topic, lambda event: self._news.put(event[1]))
        try:
            while len(self.finished) + len(self.failed) < len(self._totals):
                self._look_around()
                self._hand_out()
                self._take()
                self._see()
                self._show(self)
        finally:
            self.stop()
            for path in token.parent.glob(f"{token.name}*"):
                path.unlink(missing_ok=True)

    def stop(self) -> None:
        """Cancel the chunks under way: workers end their processes."""
        futures = [w.future for w in self.workers.values() if w.future is not None]
        if futures and self._client.status == "running":
            with suppress(Exception):  # the scheduler may be gone
                self._client.cancel(futures, force=True)

    # Workers ----------------------------------------------------------------------------------

    def _look_around(self) -> None:
        """Notice workers that came, went, or hang."""
        now = time.monotonic()
        if now - self._looked < POLL_S:
            return
        self._looked = now
        there = self._described()
        for address, info in there.items():
            if address in self.workers and self.workers[address].state != "gone":
                continue
            name = str(info.get("name", address))
            name = address if name == address else f"{name} ({address})"
            if tagged(info):
                self._examine(Worker(address, name))
            else:
                self._tell(
                    f"worker {name}: has no resource {RESOURCE!r} and is left out; start it with: "
                    f"dask worker --resources {RESOURCE}=1"
                )
        limit = self._order.patience_s + SILENT_S
        for worker in self.workers.values():
            if worker.state != "gone" and worker.address not in there:
                self._lose(worker, "gone", "the worker is gone")
            elif worker.state == "busy" and worker.heard and now - worker.heard > limit:
                self._lose(worker, "out", f"the worker has not answered for {limit:.0f} s")
        if any(w.works or w.state == "examined" for w in self.workers.values()):
            self._alone_since = now
        elif now - self._alone_since > ALONE_S or self._all("out"):
            raise IprtError(self._nobody())

    def _all(self, state: State) -> bool:
        return bool(self.workers) and all(w.state == state for w in self.workers.values())

    def _described(self) -> Mapping[str, Mapping[str, Any]]:
        """Return the scheduler's description of its workers, by address."""
        try:
            if self._client.status != "running":
                raise OSError("the connection is lost")
            # `scheduler_info` can return what its periodic update has fetched, without workers.
            info = self._client.sync(self._client.scheduler.identity, n_workers=-1)
            return dict(info["workers"])
        except (OSError, TimeoutError, RuntimeError) as error:
            raise self._scheduler_lost() from error

    def _scheduler_lost(self) -> IprtError:
        return IprtError("the scheduler of the cluster is gone, or was started again")

    def _nobody(self) -> str:
        problems = [w.device for w in self.workers.values() if w.state == "out"]
        if problems:
            return f"no worker of the cluster can render: {problems[0]}"
        return (
            "the cluster has no workers that render; start some: dask worker SCHEDULER "
            f"--nthreads 1 --resources {RESOURCE}=1"
        )

    def _examine(self, worker: Worker) -> None:
        self.workers[worker.address] = worker
        worker.future = self._submit(worker, "examine", self._look, self._order, self._token)

    def _admit(self, worker: Worker, found: Mapping[str, str]) -> None:
        """Let an examined worker render, or tell why not."""
        problem = found.get("problem")
        if problem is None and not (Path(self._order.parts) / found["mark"]).exists():
            problem = (
                f"{self._order.parts}: a file that it has written there is not seen here; mount "
                "the same storage at the same path"
            )
        if problem is not None:
            self._leave_out(worker, problem)
            return
        worker.state, worker.device = "free", found["device"]
        devices = {w.device for w in self.workers.values() if w.works}
        if len(devices) > 1:
            self._tell(
                f"the workers' devices differ ({', '.join(sorted(devices))}): frames may differ "
                "in their last bits"
            )

    def _leave_out(self, worker: Worker, problem: str) -> None:
        worker.state, worker.device = "out", f"worker {worker.name}: {problem}"
        self._tell(f"worker {worker.name} is left out: {problem}")

    def _lose(self, worker: Worker, state: State, reason: str) -> None:
        """Note that a worker renders no more, and give its chunk to another."""
        chunk, future = worker.chunk, worker.future
        worker.end()
        worker.state = state
        if state == "out":
            worker.device = f"worker {worker.name}: {reason}"
        if future is not None:
            future.cancel(force=True)
        if chunk is not None:
            self._settle(worker, chunk, Outcome(-1, 0, 0.0, reason))

    def _tell(self, line: str, level: int = logging.WARNING) -> None:
        """Log a line, once."""
        if line not in self._told:
            self._told.add(line)
            LOG.log(level, "%s", line)

    # Chunks -----------------------------------------------------------------------------------

    def _hand_out(self) -> None:
        """Give each free worker the first chunk that it may render."""
        for worker in self.workers.values():
            if worker.state == "free" and (chunk := self._next_for(worker)) is not None:
                self._pending.remove(chunk)
                self._tried[chunk].append(worker.address)
                name = f"{chunk}-{len(self._tried[chunk])}"
                future = self._submit(
                    worker, name, self._render, self._order, chunk, resources={RESOURCE: 1}
                )
                worker.begin(chunk, future)

    def _next_for(self, worker: Worker) -> int | None:
        working = {w.address for w in self.workers.values() if w.works}
        for chunk in self._pending:
            tried = self._tried[chunk]
            if worker.address not in tried or not working.difference(tried):
                return chunk
        return None

    def _submit(
        self, worker: Worker, name: str, task: Callable[..., Any], *words: Any, **options: Any
    ) -> Future:
        future = self._client.submit(
            task,
            *words,
            key=f"{self._order.topic}-{name}-{uuid.uuid4().hex[:8]}",
            workers=[worker.address],
            allow_other_workers=False,
            pure=False,
            **options,
        )
        future.add_done_callback(lambda ended: self._news.put((worker, ended)))
        return future

    def _take(self) -> None:
        """Wait for news for a while, and note all of them."""
        with suppress(queue.Empty):
            self._note(self._news.get(timeout=POLL_S / 2))
            while True:
                self._note(self._news.get_nowait())

    def _note(self, news: tuple[Worker, Future] | dict[str, Any]) -> None:
        if isinstance(news, dict):
            worker = self.workers.get(news["worker"])
            if worker is not None and worker.chunk == news["chunk"]:
                worker.advance(news["done"])
                self._known[news["chunk"]] = news["done"]
            return
        worker, future = news
        if worker.future is not future:  # given up meanwhile
            return
        if future.status == "cancelled":
            raise self._scheduler_lost()
        chunk, examined = worker.chunk, worker.state == "examined"
        try:
            result, problem = _result(future)
        except TimeoutError:
            # It died with its result. If it did not, it is found and examined again.
            self._lose(worker, "gone", "the worker is gone")
            return
        worker.end()
        if examined:
            self._admit(worker, result or {"problem": problem})
        elif chunk is not None:
            self._settle(worker, chunk, result or Outcome(-1, 0, 0.0, problem))

    def _settle(self, worker: Worker, chunk: int, outcome: Outcome) -> None:
        """Note the end of a chunk's task: it is complete, or is tried again, or failed."""
        for remark in outcome.remarks:
            self._tell(remark, logging.INFO)
        if self._finish(worker, chunk):
            return
        if outcome.code == 0:
            self._unseen[chunk] = worker, time.monotonic() + SETTLE_S
        else:
            self._fail(worker, chunk, outcome.line, final=_final(outcome))

    def _finish(self, worker: Worker, chunk: int) -> bool:
        """Note a chunk as finished if all its files are there, and return whether they are."""
        if not self._complete(chunk):
            return False
        worker.strikes = 0
        self.finished.add(chunk)
        self._known[chunk] = self._totals[chunk]
        return True

    def _see(self) -> None:
        """Look for the files of chunks that workers have finished."""
        for chunk, (worker, until) in list(self._unseen.items()):
            if self._finish(worker, chunk):
                del self._unseen[chunk]
            elif time.monotonic() > until:
                del self._unseen[chunk]
                self._fail(worker, chunk, "its files are not seen here", final=False)

    def _fail(self, worker: Worker, chunk: int, reason: str, *, final: bool) -> None:
        """Note a failure; the chunk is tried again unless it is final, or the last of `TRIES`."""
        told = f"chunk {chunk} failed on worker {worker.name}: {reason}"
        tries = len(self._tried[chunk])
        if final or tries == TRIES:
            self.failed[chunk] = f"{reason} (worker {worker.name})"
            LOG.warning("%s%s", told, "" if tries == 1 else f"; it has been tried {tries} times")
        else:
            LOG.warning("%s; it is tried again", told)
            bisect.insort(self._pending, chunk)
        if not final:
            worker.strikes += 1
        others = any(w.works for w in self.workers.values() if w is not worker)
        if worker.strikes >= STRIKES and others and worker.works:
            self._leave_out(worker, f"{counted(worker.strikes, 'chunk')} failed in a row: {reason}")


def _final(outcome: Outcome) -> bool:
    """Return whether a failure would be the same on every worker."""
    return outcome.code == BAD_INPUT and not any(text in outcome.line for text in STORAGE)


def _result(future: Future) -> tuple[Any, str]:
    """Return the result of a task, or None and the reason why there is none.

    Raises
    ------
    TimeoutError
        The result was lost.
    """
    if future.status == "lost":
        raise TimeoutError
    try:
        return future.result(timeout=RESULT_S), ""
    except TimeoutError:
        raise
    except ModuleNotFoundError as error:
        return None, f"has no iprt, or an older one ({error}); install the same version there"
    except Exception as error:
        name = type(error).__name__
        return None, printable(f"{name}: {error}", LONGEST)
