"""The queue of renders, whose processes only pretend to render."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from iprt.errors import IprtError
from iprt.files.progress_line import ProgressLine
from iprt.scene.scene import Scene
from iprt.viewer import render_queue
from iprt.viewer.render_fields import render_words
from iprt.viewer.render_queue import Pace, RenderQueue
from tests.commands.test_faults import child_of
from tests.viewer.orders import begun, ended, order, render, temporary
from tests.waiting import DEADLINE_S, until

CLIP_FRAMES = 3
PRETENDER = """
import os, sys, time
words = dict(word.removeprefix("--").partition("=")[::2] for word in sys.argv[1:])
output = words["output"]
with open(os.path.join(os.path.dirname(output), "started"), "a") as log:
    log.write(f"{os.path.basename(output)} {os.getpid()}\\n")
print("progress 0/3: reading the scene", file=sys.stderr, flush=True)
if "bad" in output:
    sys.exit(f"iprt: a remark\\niprt: error: {sys.argv[1]}/scene.toml: is wrong")
if "slow" in output:
    time.sleep(600)
print("progress 2/3", file=sys.stderr, flush=True)
open(output, "w").write(words["device"])
"""
"""`iprt render` that fails if `bad` is in the file's name, and does not end if `slow` is."""


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return temporary(tmp_path / "scratch", monkeypatch)


@pytest.fixture
def queue(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RenderQueue]:
    monkeypatch.setattr(render_queue, "COMMAND", (sys.executable, "-c", PRETENDER))
    queue = RenderQueue("a device")
    yield queue
    queue.close()
    assert not list(scratch.iterdir())


def started(folder: Path) -> dict[str, int]:
    """The names of files, in the order in which their processes started, and their numbers."""
    lines = (line.split() for line in (folder / "started").read_text().splitlines())
    return {name: int(number) for name, number in lines}


def runs(process: int) -> bool:
    """Whether there is such a process, be it a zombie."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_renders_follow_each_other_whatever_becomes_of_one(
    queue: RenderQueue, scene: Scene, tmp_path: Path
) -> None:
    names = ["c.png", "bad.png", "a.png", "b.mp4"]
    for name in names:
        queue.add(order(scene, tmp_path / name))
    assert list(ended(queue).items()) == [
        ("c.png", "finished"),
        ("bad.png", "failed"),
        ("a.png", "finished"),
        ("b.mp4", "finished"),
    ]
    assert list(started(tmp_path)) == names
    assert (tmp_path / "a.png").read_text() == "a device"
    problem = render(queue, 2).problem
    assert problem == f"{scene.root}/scene.toml: is wrong", "the user's file, not the copy"
    assert render_words(render(queue, 2)) == problem
    assert render(queue, 1).share == 1.0


def test_cancelling_ends_the_process_and_goes_on(
    queue: RenderQueue, scene: Scene, tmp_path: Path
) -> None:
    slow, waiting, last = (
        queue.add(order(scene, tmp_path / name)) for name in ("slow.png", "b.png", "c.png")
    )
    begun(queue, slow)
    assert render_words(render(queue, slow)) == "0 of 3 frames: reading the scene"
    assert render_words(render(queue, waiting)) == "waiting"
    queue.cancel(waiting)
    queue.cancel(slow)
    states = ended(queue)
    assert states == {"slow.png": "cancelled", "b.png": "cancelled", "c.png": "finished"}
    assert list(started(tmp_path)) == ["slow.png", "c.png"]
    assert not runs(started(tmp_path)["slow.png"])
    queue.cancel(last)
    assert render(queue, last).state == "finished", "it is too late"
    queue.again(waiting)
    assert ended(queue)["b.png"] == "finished"
    assert [r.number for r in queue.renders] == [slow, last, last + 1]


def test_closing_leaves_no_process_and_no_folder(
    queue: RenderQueue, scene: Scene, scratch: Path, tmp_path: Path
) -> None:
    number = queue.add(order(scene, tmp_path / "slow.png"))
    queue.add(order(scene, tmp_path / "b.png"))
    begun(queue, number)
    assert queue.open == ("slow.png", "b.png")
    assert list(scratch.iterdir())
    queue.close()
    assert queue.open == ()
    assert not runs(started(tmp_path)["slow.png"])
    assert not list(scratch.iterdir())
    assert not (tmp_path / "b.png").exists()


def test_a_signal_ends_the_process_too(scene: Scene, tmp_path: Path) -> None:
    """And removes the folder, and names the file."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    code = (
        "import signal, sys, time; from pathlib import Path\n"
        "from iprt.files.termination import end_on_signals; end_on_signals()\n"
        "from iprt.scene.scene import Scene; from iprt.viewer import render_queue\n"
        "from tests.viewer.orders import begun, order, temporary\n"
        f"render_queue.COMMAND = (sys.executable, '-c', {PRETENDER!r})\n"
        f"queue, out = render_queue.RenderQueue('a device'), Path({str(tmp_path)!r})\n"
        f"number = queue.add(order(Scene.open(Path({str(scene.root)!r})), out / 'slow.png'))\n"
        "begun(queue, number); print('begun', flush=True); time.sleep(600)\n"
    )
    with child_of(f"import tempfile; tempfile.tempdir = {str(scratch)!r}\n{code}") as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "begun\n"
        assert list(scratch.iterdir())
        child.terminate()
        _, told = child.communicate(timeout=DEADLINE_S)
    assert told == "iprt: terminated by SIGTERM; not rendered to the end: slow.png\n"
    assert not runs(started(tmp_path)["slow.png"])
    assert not list(scratch.iterdir())


def test_orders_that_cannot_be_are_refused_at_once(
    queue: RenderQueue, scene: Scene, tmp_path: Path
) -> None:
    old, file, three = tmp_path / "old.png", tmp_path / "file", scene.frame_indices
    old.touch()
    file.touch()
    odd = scene.views["ahead"].view.resized(31, 16)
    queue.add(order(scene, tmp_path / "slow.png"))
    for refused, told in (
        (order(scene, old), "exists already"),
        (order(scene, tmp_path / "slow.png"), "in the queue already"),
        (order(scene, tmp_path / "a.jpg"), "unknown output format '.jpg'"),
        (order(scene, file / "a.png"), "is a file, not a folder"),
        (order(scene, scene.root / "scene.toml"), "unknown output format"),
        (order(scene, tmp_path / "a.png", frames=three), "3 frames are asked for"),
        (order(scene, tmp_path / "a.mp4", frames=three, view=odd), "even sides"),
        (order(scene, tmp_path / "a.mp4", frames=three, quality="final"), "has converged"),
    ):
        with pytest.raises(IprtError, match=told) as error:
            queue.add(refused)
        assert "\n" not in str(error.value)
    assert queue.open == ("slow.png",)


def test_a_program_that_cannot_start_is_told(
    queue: RenderQueue, scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render_queue, "COMMAND", (str(tmp_path / "missing"),))
    number = queue.add(order(scene, tmp_path / "a.png"))
    until(lambda: render(queue, number).state == "failed")
    assert "missing: No such file" in render(queue, number).problem


def test_the_time_left_counts_from_the_first_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before it, kernels are compiled. A second try after a lost device begins anew."""
    times = {0.0: 2, 50.0: 2, 60.0: 3, 64.0: 5, 70.0: 1, 90.0: 2, 91.0: 3}
    clock = iter(times)
    monkeypatch.setattr(render_queue.time, "monotonic", lambda: next(clock))
    pace = Pace()
    left = [pace.left_s(ProgressLine(done, 10)) for done in times.values()]
    assert left == [None, None, None, 10.0, None, None, 7.0]
