"""Films rendered by workers of dask: the same files, whoever renders, and messages."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.commands.join import join_chunks
from iprt.commands.render_flags import RenderFlags
from iprt.commands.render_video import expected_metadata, film_plan
from iprt.files.progress_line import ProgressLine
from iprt.output.film_output import FilmOutput
from iprt.renderer import RenderedFrame
from tests.clips import write_clip
from tests.farm.cluster.machines import (
    CHUNKS,
    FRAMES,
    ROOT,
    digests,
    environment,
    scheduler,
    wait_ended,
    words,
    worker,
)

pytest.importorskip("distributed", reason="needs the extra `cluster`")
pytestmark = pytest.mark.cluster
DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")
Render = Callable[..., tuple[int, list[str]]]


def test_workers_of_this_machine_make_the_same_film(
    render: Render, film: Path, alone: dict[str, str], standin: None
) -> None:
    code, said = render("local:2", f"--device={DEVICE}")
    assert (code, said) == (0, [])
    assert digests(film.parent) == alone


@pytest.mark.thorough
def test_eight_workers_in_a_random_order_make_the_same_film(
    render: Render,
    film: Path,
    alone: dict[str, str],
    standin: None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("STANDIN_SEED", "3")
    monkeypatch.setenv("STANDIN_S", "0.2")
    assert render("local:8", f"--device={DEVICE}") == (0, [])
    assert digests(film.parent) == alone


def test_a_second_start_renders_what_is_missing(
    render: Render, film: Path, alone: dict[str, str], tmp_path: Path
) -> None:
    """Here after chunk 1 crashed three times, each time but the last on another worker."""
    faults, log, file = (tmp_path / name for name in ("faults", "log", "scheduler.json"))
    for folder in (faults, log):
        folder.mkdir()
    for number in range(3):
        (faults / f"crash-1-{number}").touch()
    own = {"STANDIN_FAULTS": faults, "STANDIN_LOG": log}
    with scheduler(file), worker(file, "a", **own), worker(file, "b", **own):
        code, said = render(file)
        assert code == 2
        assert sum("chunk 1 failed on worker" in line for line in said) == 3
        error = said[-1]
        assert error.startswith(f"iprt: error: {film}: 1 chunk failed (1): chunk 1: ")
        assert "it was ended by SIGSEGV" in error
        assert f"of {FRAMES} frames finished; the same command continues from there" in error
        assert not film.exists()
        for path in log.iterdir():
            path.unlink()
        code, said = render(file)
    assert code == 0, said
    assert {path.name.partition("-")[0] for path in log.iterdir()} == {"1"}
    assert digests(film.parent) == alone


def test_bad_input_is_not_tried_again(render: Render, film: Path, tmp_path: Path) -> None:
    faults, log, file = (tmp_path / name for name in ("faults", "log", "scheduler.json"))
    for folder in (faults, log):
        folder.mkdir()
    (faults / "bad-1-1").touch()
    own = {"STANDIN_FAULTS": faults, "STANDIN_LOG": log}
    with scheduler(file), worker(file, "a", **own), worker(file, "b", **own):
        code, said = render(file)
    assert code == 2
    assert "chunk 1: frame 7: is damaged (worker " in said[-1]
    assert len(list(log.glob("1-*"))) == 1
    assert len(list(log.iterdir())) == CHUNKS, "the others go on"


def test_numbered_pictures_by_devices_that_differ(
    clip: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A worker without the tag is named and renders nothing; different devices are named, too."""
    log, file, out = tmp_path / "log", tmp_path / "scheduler.json", tmp_path / "out"
    log.mkdir()
    with (
        scheduler(file),
        worker(file, "a", STANDIN_LOG=log, STANDIN_DEVICE="one", STANDIN_S=0.2),
        worker(file, "b", STANDIN_LOG=log, STANDIN_DEVICE="two", STANDIN_S=0.2),
        worker(file, "idle", tag="", STANDIN_LOG=log, STANDIN_DEVICE="three"),
    ):
        assert cli.main(words(clip, out / "%04d.png", file)) == 0
    said = caplog.text
    assert "idle (tcp://127.0.0.1:" in said
    assert "has no resource 'iprt' and is left out" in said
    assert "the workers' devices differ (one (none), two (none))" in said
    told = {path.read_text().split()[1] for path in log.iterdir()}
    assert told == {"one", "two"}
    assert len(list(out.glob("*.png"))) == FRAMES


def test_pictures_of_a_moving_view_are_joined(tmp_path: Path) -> None:
    """Each tells its own view."""
    scene, output = write_clip(tmp_path / "clip", 20), tmp_path / "out" / "%02d.png"
    with (scene / "scene.toml").open("a") as file:
        for moment in (0.0, 1.0):
            file.write(f"[[views.keyframes]]\ntime = {moment}\nyaw_deg = {90 * moment}\n")
    job = RenderFlags(output=output, chunk=8).job(scene)
    plan = film_plan(job)
    film = FilmOutput(output, plan, plan.chunks.numbers, expected_metadata(job, plan))
    for number in film.numbers:
        for index in film.missing(number):
            film.write(number, index, RenderedFrame(np.zeros((16, 32, 3), "f4"), {}), "a device")
        film.fade(number)
    join_chunks(output, plan)
    assert len(list(output.parent.iterdir())) == 20


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_renders_and_keeps_what_is_finished(
    number: signal.Signals, render: Render, clip: Path, film: Path, alone: dict[str, str]
) -> None:
    line = [sys.executable, "-m", "iprt", *words(clip, film, "local:2", f"--device={DEVICE}")]
    slow = environment(STANDIN_S=0.2)
    with subprocess.Popen(
        line, env=slow, cwd=ROOT, stderr=subprocess.PIPE, text=True, process_group=0
    ) as client:
        assert client.stderr is not None
        for told in client.stderr:
            progress = ProgressLine.of(told.rstrip())
            if progress is not None and progress.done >= 4:
                break
        client.send_signal(number)
        said = client.stderr.read()
    assert client.returncode == 128 + number
    assert f"of {FRAMES} frames finished; the same command continues from there\n" in said
    wait_ended(film)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", environment()["PYTHONPATH"])
        assert render("local:2", f"--device={DEVICE}")[0] == 0
    assert digests(film.parent) == alone


@pytest.mark.thorough
def test_real_renders_by_two_workers_are_those_of_one_process(tmp_path: Path) -> None:
    scene = write_clip(tmp_path / "clip", 20)
    flags = ["--chunk=8", "--accumulate=2", "--set=iprt.ratio_rows=16", "--set=irradiance.rows=32"]
    for name, more in (("one", []), ("two", ["--cluster=local:2"])):
        output = tmp_path / name / "film.mp4"
        line = ["render", str(scene), f"--output={output}", f"--device={DEVICE}", *flags, *more]
        assert cli.main(line) == 0
    assert digests(tmp_path / "one") == digests(tmp_path / "two")
