"""A clip, the film that one process renders of it, and a cluster of two workers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from iprt import cli
from tests.clips import write_clip
from tests.farm.cluster.machines import (
    FRAMES,
    STANDIN,
    digests,
    rendered_alone,
    scheduler,
    wait_ended,
    words,
    worker,
)


@pytest.fixture(scope="session")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_clip(tmp_path_factory.mktemp("farm") / "clip", FRAMES)


@pytest.fixture(scope="session")
def alone(clip: Path) -> dict[str, str]:
    """Digests of the film as one process renders it."""
    rendered_alone(clip, clip.parent / "alone" / "film.mp4")
    return digests(clip.parent / "alone")


@pytest.fixture
def film(tmp_path: Path) -> Iterator[Path]:
    """Yield the path of a film, and wait afterwards until no process renders it."""
    yield tmp_path / "out" / "film.mp4"
    wait_ended(tmp_path / "out" / "film.mp4")


@pytest.fixture
def standin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let workers of this process's clusters render stand-ins."""
    monkeypatch.setenv("PYTHONPATH", str(STANDIN))


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The scheduler file of a cluster with two workers."""
    file = tmp_path_factory.mktemp("cluster") / "scheduler.json"
    with ExitStack() as stack:
        stack.enter_context(scheduler(file))
        for name in ("a", "b"):
            stack.enter_context(worker(file, name))
        yield file


@pytest.fixture
def render(
    clip: Path,
    film: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> Callable[..., tuple[int, list[str]]]:
    """`iprt render` of the film on a cluster: the exit code, and the lines said but progress."""

    def run(where: object, *more: str) -> tuple[int, list[str]]:
        caplog.clear()
        code = cli.main(words(clip, film, where, *more))
        lines = capsys.readouterr().err.splitlines()
        logged = [one.getMessage() for one in caplog.records if one.name.startswith("iprt")]
        return code, logged + [line for line in lines if not line.startswith("progress ")]

    return run
