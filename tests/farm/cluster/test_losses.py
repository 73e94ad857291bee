"""Workers, schedulers and clients that are killed, hang, are slow or have full disks.

The film is the same each time, after a second start if the first one could not finish it.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from tests.farm.cluster.machines import (
    CHUNKS,
    ROOT,
    digests,
    environment,
    scheduler,
    wait_begun,
    wait_ended,
    words,
    worker,
)
from tests.waiting import DEADLINE_S, until

pytest.importorskip("distributed", reason="needs the extra `cluster`")
pytestmark = pytest.mark.cluster
Render = Callable[..., tuple[int, list[str]]]
SEEDS = [pytest.param(s, marks=[] if s < 1 else pytest.mark.thorough) for s in range(20)]
SPREAD_S = 4.0
"""Range of seconds after the first chunk's start from which the moments of losses are drawn."""


@contextmanager
def meanwhile(action: Callable[[], None]) -> Iterator[None]:
    """Act in a thread."""
    thread = threading.Thread(target=action)
    thread.start()
    try:
        yield
    finally:
        thread.join(DEADLINE_S)


def kill(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError):
        os.kill(process.pid, signal.SIGKILL)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(path.read_text().rpartition(")")[2].split()[1]) == pid:
                found.append(int(path.parent.name))
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_killed_workers(
    seed: int, render: Render, film: Path, alone: dict[str, str], tmp_path: Path
) -> None:
    """Two die at random moments, with a third one there; a new one comes."""
    dice, file = random.Random(seed), tmp_path / "scheduler.json"
    with ExitStack() as stack:
        stack.enter_context(scheduler(file))
        begin = [stack.enter_context(worker(file, n, STANDIN_S=0.05)) for n in "abc"]

        def act() -> None:
            wait_begun(film)
            for victim in dice.sample(begin, 2):
                time.sleep(dice.uniform(0.0, SPREAD_S / 2.0))
                kill(victim)
            stack.enter_context(worker(file, "d", STANDIN_S=0.05))

        with meanwhile(act):
            code, said = render(file)
    assert code == 0, said
    assert digests(film.parent) == alone


@pytest.mark.parametrize("seed", SEEDS)
def test_a_killed_scheduler(
    seed: int, render: Render, film: Path, alone: dict[str, str], tmp_path: Path
) -> None:
    dice, file = random.Random(seed), tmp_path / "scheduler.json"
    with (
        scheduler(file) as lost,
        worker(file, "a", STANDIN_S=0.1),
        worker(file, "b", STANDIN_S=0.1),
    ):

        def act() -> None:
            wait_begun(film)
            time.sleep(dice.uniform(0.0, SPREAD_S))
            kill(lost)

        with meanwhile(act):
            code, said = render(file)
        if code != 0:
            assert said[-1].startswith("iprt: error: the scheduler of the cluster is gone")
        wait_ended(film)
    with scheduler(file), worker(file, "a"), worker(file, "b"):
        code, said = render(file)
    assert code == 0, said
    assert digests(film.parent) == alone


@pytest.mark.parametrize("seed", SEEDS)
def test_a_killed_client(
    seed: int, render: Render, clip: Path, film: Path, alone: dict[str, str], cluster: Path
) -> None:
    """Workers notice the loss of their client, and end its renders."""
    dice = random.Random(seed)
    line = [sys.executable, "-m", "iprt", *words(clip, film, cluster)]
    with subprocess.Popen(line, env=environment(), cwd=ROOT, stderr=subprocess.DEVNULL) as client:
        wait_begun(film)
        time.sleep(dice.uniform(0.0, SPREAD_S))
        client.kill()
    wait_ended(film)
    code, said = render(cluster)
    assert code == 0, said
    assert digests(film.parent) == alone


def test_a_killed_client_takes_its_own_workers_along(
    render: Render, clip: Path, film: Path, standin: None
) -> None:
    line = [sys.executable, "-m", "iprt", *words(clip, film, "local:2")]
    slow = environment(STANDIN_S=30)
    with subprocess.Popen(line, env=slow, cwd=ROOT, stderr=subprocess.DEVNULL) as client:
        wait_begun(film)
        client.kill()
    wait_ended(film)


def test_a_render_ends_with_its_killed_worker(clip: Path, film: Path, tmp_path: Path) -> None:
    file = tmp_path / "scheduler.json"
    line = [sys.executable, "-m", "iprt", *words(clip, film, file)]
    with (
        scheduler(file),
        worker(file, "a", STANDIN_S=30) as lost,
        subprocess.Popen(line, env=environment(), cwd=ROOT, stderr=subprocess.DEVNULL) as client,
    ):
        wait_begun(film)
        kill(lost)
        wait_ended(film)
        client.kill()


@pytest.mark.thorough
def test_a_render_that_hangs_is_ended_and_tried_elsewhere(
    render: Render,
    film: Path,
    alone: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("iprt.commands.render_cluster.START_S", 9.0)
    faults, file = tmp_path / "faults", tmp_path / "scheduler.json"
    faults.mkdir()
    (faults / "hang-2-1").touch()
    own = {"STANDIN_FAULTS": faults}
    with scheduler(file), worker(file, "a", **own), worker(file, "b", **own):
        code, said = render(file, "--frame-limit=1")
    assert code == 0, said
    assert len(said) == 1
    assert said[0].startswith("chunk 2 failed on worker ")
    assert said[0].endswith("s: it hangs, and was ended; it is tried again")
    assert digests(film.parent) == alone


@pytest.mark.thorough
def test_a_worker_that_hangs_loses_its_chunk(
    render: Render,
    film: Path,
    alone: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("iprt.commands.render_cluster.START_S", 15.0)
    monkeypatch.setattr("iprt.farm.dispatch.SILENT_S", 3.0)
    file = tmp_path / "scheduler.json"
    with scheduler(file), worker(file, "a", STANDIN_S=0.1) as hung:

        def act() -> None:
            wait_begun(film)
            until(lambda: any(film.with_name("film.mp4.parts").glob("*.np*")))
            os.kill(hung.pid, signal.SIGSTOP)
            for child in children(hung.pid):  # it would finish the chunk
                os.kill(child, signal.SIGKILL)

        with worker(file, "b", STANDIN_S=0.1), meanwhile(act):
            code, said = render(file, "--frame-limit=1")
        assert code == 0, said
        assert any(
            "the worker has not answered for 19 s; it is tried again" in line for line in said
        )
    assert digests(film.parent) == alone


@pytest.mark.thorough
def test_a_slow_worker_gets_fewer_chunks(
    render: Render, film: Path, alone: dict[str, str], tmp_path: Path
) -> None:
    log, file = tmp_path / "log", tmp_path / "scheduler.json"
    log.mkdir()
    with (
        scheduler(file),
        worker(file, "slow", STANDIN_LOG=log, STANDIN_DEVICE="slow", STANDIN_S=1.0),
        worker(file, "quick", STANDIN_LOG=log, STANDIN_DEVICE="quick"),
    ):
        assert render(file)[0] == 0
    told = [path.read_text().split()[1] for path in log.iterdir()]
    assert len(told) == CHUNKS
    assert told.count("quick") > told.count("slow")
    assert digests(film.parent) == alone


def test_a_full_disk_of_one_worker(
    render: Render, film: Path, alone: dict[str, str], tmp_path: Path
) -> None:
    """Its chunks are rendered by the other one, and it gets no more after three."""
    file = tmp_path / "scheduler.json"
    with (
        scheduler(file),
        worker(file, "full", STANDIN_FSIZE=500),
        worker(file, "good", STANDIN_S=0.3),
    ):
        code, said = render(file)
    assert code == 0, said
    failed = [line for line in said if "failed on worker full (" in line]
    assert len(failed) == 3
    assert all("cannot be written: File too large; it is tried again" in line for line in failed)
    assert any("worker full (" in line and "is left out: 3 chunks failed" in line for line in said)
    assert digests(film.parent) == alone


@pytest.mark.thorough
def test_clocks_that_differ_by_hours(
    render: Render, film: Path, alone: dict[str, str], tmp_path: Path
) -> None:
    """And so do the times of files."""
    log, file = tmp_path / "log", tmp_path / "scheduler.json"
    log.mkdir()
    own = {"STANDIN_LOG": log, "STANDIN_S": 0.1}
    with (
        scheduler(file),
        worker(file, "early", STANDIN_SKEW_H=-5, **own),
        worker(file, "late", STANDIN_SKEW_H=7, **own),
    ):
        code, said = render(file)
    assert (code, said) == (0, [])
    hours = {round((float(p.read_text().split()[0]) - time.time()) / 3600) for p in log.iterdir()}
    assert hours == {-5, 7}
    assert digests(film.parent) == alone
