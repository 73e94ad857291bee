"""`iprt render` ended, hindered or hung in the middle: whole files or none, one line, a code."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.files.lock import NAME, locked
from iprt.output.picture import write_picture
from iprt.renderer import Renderer
from tests.scene.files import write_rgb
from tests.waiting import DEADLINE_S, until

ROOT = Path(__file__).parents[2]
DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")
SPIN = """
__kernel void spin(__global volatile int *sum)
{
    for (int i = 0; i < INT_MAX; i++)
        for (int j = 0; j < 1000000; j++)
            sum[0] += j;
}
"""
SMALL = ("--size", "24", "16", "--method", "ibl", "--accumulate", "1", "--device", DEVICE)
"""The method has the fewest kernels."""


@contextmanager
def child_of(code: str) -> Iterator[subprocess.Popen[str]]:
    """A Python process with default signals, which a shell's background would have taken away.

    They are blocked until `end_on_signals`, as that comes after the imports of `code`, and those
    start threads. It does not outlive the block.
    """
    start = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    start += "signal.signal(signal.SIGHUP, signal.SIG_DFL)\n"
    start += "signal.pthread_sigmask(signal.SIG_BLOCK, (1, 2, 15))\n"
    with subprocess.Popen(
        [sys.executable, "-c", start + code],
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        try:
            yield child
        finally:
            child.kill()


@contextmanager
def rendering(scene: Path, picture: Path) -> Iterator[subprocess.Popen[str]]:
    """A render that would take hours, in its frames or (as that costs nothing) in between."""
    started = scene / "started"
    words = ["render", str(scene), "-o", str(picture), *SMALL, "--accumulate", "1000000"]
    code = (
        "import time; from pathlib import Path; from iprt import cli, renderer\n"
        "step = renderer.Renderer.step\n"
        "def marked(self):\n"
        f"    step(self); Path({str(started)!r}).touch(); time.sleep(0.05)\n"
        "renderer.Renderer.step = marked\n"
        f"cli.command({words!r})"
    )
    with child_of(code) as child:
        until(lambda: started.exists() or child.poll() is not None)
        yield child


@pytest.mark.thorough
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_a_render_without_traces(
    number: signal.Signals, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    """Meanwhile a second render into the folder is refused, whatever its picture's name."""
    out = tmp_path / "out"
    with rendering(scene, out / "a.png") as child:
        line = fails("render", scene, "-o", out / "b.png", *SMALL)
        assert f"{out}: process {child.pid} on " in line
        assert "renders into this folder; wait for it or name another one" in line
        child.send_signal(number)
        stdout, stderr = child.communicate(timeout=DEADLINE_S)
    assert child.returncode == 128 + number
    assert stderr == (
        "iprt: interrupted\n" if number is signal.SIGINT else f"iprt: terminated by {number.name}\n"
    )
    assert stdout == ""
    assert not out.exists()


def test_compare_takes_its_folder_too(
    scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    with (scene / "scene.toml").open("a") as file:
        file.write('truth = "truth.exr"\n')
    write_rgb(scene / "truth.exr", np.ones((24, 32, 3), np.float32))
    with locked(tmp_path / "out"):
        line = fails("compare", scene, "--save", tmp_path / "out", "--device", DEVICE)
    assert f"out: process {os.getpid()} on " in line


@pytest.mark.thorough
def test_a_killed_render_does_not_block_its_folder(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with rendering(scene, out / "a.png") as child:
        child.kill()
        child.wait(timeout=DEADLINE_S)
    assert [path.name for path in out.iterdir()] == [NAME]
    assert cli.main(["render", str(scene), "-o", str(out / "a.png"), *SMALL]) == 0
    assert [path.name for path in out.iterdir()] == ["a.png"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_mid_write_keeps_the_old_picture(
    number: signal.Signals, tmp_path: Path
) -> None:
    picture = tmp_path / "a.png"
    write_picture(picture, np.ones((8, 8, 3), np.float32))
    before = picture.read_bytes()
    code = (
        "import os, sys, time; from pathlib import Path; import numpy as np\n"
        "from PIL import Image; from iprt import cli\n"
        "from iprt.output.picture import write_picture\n"
        "def save(self, target, **_):\n"
        "    Path(target).write_bytes(b'half')\n"
        f"    os.kill(os.getpid(), {int(number)})\n"
        "    for _ in range(3000): time.sleep(0.01)  # signals arrive a little later\n"
        "    print('written to the end', file=sys.stderr)\n"
        "Image.Image.save = save\n"
        "def verb():\n"
        "    '''Write.'''\n"
        f"    write_picture(Path({str(picture)!r}), np.zeros((8, 8, 3), np.float32))\n"
        "cli.VERBS = {'go': 'm:f', 'other': 'm:f'}; cli._load = lambda _: verb\n"
        "cli.command(['go'])"
    )
    with child_of(code) as child:
        _, stderr = child.communicate(timeout=DEADLINE_S)
    assert child.returncode == 128 + number
    assert stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert picture.read_bytes() == before


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_a_disk_that_is_full_keeps_the_old_picture(name: str, tmp_path: Path) -> None:
    """The system itself refuses to write any byte from some place on: first, middle and last."""
    noise = np.random.default_rng(1).random((32, 32, 3)).astype(np.float32)
    picture, whole = tmp_path / name, tmp_path / "whole" / name
    write_picture(picture, noise)
    write_picture(whole, 1.0 - noise)
    size = whole.stat().st_size - 1
    limits = [0, size // 2, size]
    before = picture.read_bytes()
    code = (
        "import resource, sys; from pathlib import Path; import numpy as np; from iprt import cli\n"
        "from iprt.output.picture import write_picture\n"
        "noise = np.random.default_rng(1).random((32, 32, 3)).astype(np.float32)\n"
        "def verb():\n"
        "    '''Write.'''\n"
        f"    write_picture(Path({str(picture)!r}), 1.0 - noise)\n"
        "cli.VERBS = {'go': 'm:f', 'other': 'm:f'}; cli._load = lambda _: verb\n"
        "most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]\n"
        f"for limit in {limits}:\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))\n"
        "    assert cli.main(['go']) == 2\n"
        f"    assert len(list(Path({str(tmp_path)!r}).iterdir())) == 2\n"
    )
    with child_of(code) as child:
        _, stderr = child.communicate(timeout=DEADLINE_S)
    assert child.returncode == 0, stderr
    lines = stderr.splitlines()
    assert len(lines) == len(limits)
    for line in lines:
        assert line.startswith(f"iprt: error: {picture}: cannot be written: ")
        assert "File too large" in line
    assert {path.name for path in tmp_path.iterdir()} == {name, "whole"}
    assert picture.read_bytes() == before


def during_the_render(monkeypatch: pytest.MonkeyPatch, action: Callable[[], None]) -> None:
    step = Renderer.step

    def acting(self: Renderer) -> None:
        step(self)
        action()

    monkeypatch.setattr(Renderer, "step", acting)


def test_a_folder_removed_meanwhile_is_made_again(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    during_the_render(monkeypatch, lambda: shutil.rmtree(out))
    assert cli.main(["render", str(scene), "-o", str(out / "a.png"), *SMALL]) == 0
    assert [path.name for path in out.iterdir()] == ["a.png"]


def test_a_folder_that_became_a_file_is_one_line(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[..., str]
) -> None:
    out = tmp_path / "out"

    def replace() -> None:
        shutil.rmtree(out)
        out.write_text("mine")

    during_the_render(monkeypatch, replace)
    line = fails("render", scene, "-o", out / "a.png", *SMALL)
    assert line.endswith(f"a.png: {out} is a file, not a folder\n")
    assert out.read_text() == "mine"


@pytest.mark.parametrize("limit", ["0", "-1", "nan", "inf"])
def test_frames_have_a_finite_limit(
    limit: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    words = ("render", scene, "-o", tmp_path / "a.png", f"--frame-limit={limit}")
    assert f"--frame-limit {limit}: expected seconds above 0" in fails(*words)


@pytest.mark.thorough
def test_a_device_that_hangs_ends_the_render(scene: Path, tmp_path: Path) -> None:
    """A real kernel that would take days; the process does not wait for it at its end."""
    words = ["render", str(scene), "-o", str(tmp_path / "out" / "a.png"), *SMALL]
    words += ["--frame-limit", "0.3"]
    code = (
        "import pyopencl as cl\n"
        "from iprt import cli; from iprt.device import compute\n"
        "wait = compute.ComputeDevice.wait\n"
        "def spinning(self):\n"
        f"    spin = cl.Kernel(cl.Program(self.context, {SPIN!r}).build(), 'spin')\n"
        "    buffer = cl.Buffer(self.context, cl.mem_flags.READ_WRITE, 4)\n"
        "    spin(self.queue, (1,), (1,), buffer); wait(self)\n"
        "compute.ComputeDevice.wait = spinning\n"
        f"cli.command({words!r})"
    )
    with child_of(code) as child:
        stdout, stderr = child.communicate(timeout=DEADLINE_S)
    assert child.returncode == 3, stderr
    assert "has not answered for 0.3 s: it hangs, or frames take long" in stderr
    assert stderr.count("\n") == 1
    assert stdout == ""
    assert not (tmp_path / "out").exists()
