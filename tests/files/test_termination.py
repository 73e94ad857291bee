"""Signals: the process ends at once, whatever it does, and leaves nothing half written."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest

from iprt.files import termination
from tests.commands.test_faults import DEVICE, child_of
from tests.waiting import DEADLINE_S

START = "from iprt.files.termination import *; import os, signal, sys, time\nend_on_signals()\n"
READY = "print('ready', flush=True)\n"


def ended(code: str, *signals: signal.Signals, pause_s: float = 0.0) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a process that gets signals when it has said `ready`."""
    with child_of(START + code) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        for number in signals:
            child.send_signal(number)
            time.sleep(pause_s)
        stdout, stderr = child.communicate(timeout=120)
    return child.returncode, stdout, stderr


@pytest.mark.parametrize(
    "code",
    [
        "import ctypes; libc = ctypes.CDLL(None)\n" + READY + "libc.sleep(1000)",
        READY + "while True:\n try: time.sleep(1000)\n except BaseException: pass",
        "import atexit\n@atexit.register\ndef late():\n " + READY + " time.sleep(1000)",
    ],
    ids=["in C", "swallows exceptions", "at its end"],
)
@pytest.mark.parametrize("number", termination.SIGNALS)
def test_a_signal_ends_a_process_whatever_it_does(code: str, number: signal.Signals) -> None:
    line = "interrupted" if number == signal.SIGINT else f"terminated by {number.name}"
    assert ended(code, number) == (128 + number, "", f"iprt: {line}\n")


def test_ignored_signals_stay_ignored() -> None:
    code = "signal.signal(signal.SIGHUP, signal.SIG_IGN); end_on_signals()\n" + READY
    with child_of(START.replace("\nend_on_signals()", "") + code + "time.sleep(0.5)") as child:
        assert child.stdout is not None
        child.stdout.readline()
        child.send_signal(signal.SIGHUP)
        assert child.wait(timeout=60) == 0


def test_actions_run_last_first_and_their_notes_are_told(tmp_path: Path) -> None:
    """One that fails does not keep the others from running; one that is over does not run."""
    code = (
        "def fail(): raise ValueError\n"
        f"note = lambda: open({str(tmp_path / 'made')!r}, 'x').close() or '3 are finished'\n"
        "with at_termination(lambda: 'over'): pass\n"
        "first = lambda: 'first \\udc80'\n"
        "with at_termination(note), at_termination(fail), at_termination(first):\n"
        "    sys.stdout.write('buffered'); os.write(1, b'ready\\n')\n"
        "    time.sleep(1000)"
    )
    result = ended(code, signal.SIGINT)
    assert result == (130, "buffered", "iprt: interrupted; first \\udc80; 3 are finished\n")
    assert (tmp_path / "made").exists()


@pytest.mark.thorough
@pytest.mark.parametrize("signals", [1, 2])
def test_actions_that_hang_are_not_waited_for(signals: int) -> None:
    """Not for ever after one signal, and no more after a second one."""
    code = "with at_termination(lambda: time.sleep(1000)):\n " + READY + " time.sleep(1000)"
    code, _, stderr = ended(code, *[signal.SIGTERM] * signals, pause_s=0.1)
    assert (code, stderr) == (143, "")


def test_a_second_signal_ends_what_would_wait_for_ever() -> None:
    code = (
        "import iprt.files.termination; iprt.files.termination.PATIENCE_S = 1e6\n"
        "with at_termination(lambda: (print('begun', flush=True), time.sleep(1000))):\n "
        + READY
        + " time.sleep(1000)"
    )
    with child_of(START + code) as child:
        assert child.stdout is not None
        for line in ("ready\n", "begun\n"):
            assert child.stdout.readline() == line
            child.send_signal(signal.SIGTERM)
        assert child.wait(timeout=DEADLINE_S) == 143


def test_a_key_press_that_arrives_twice_is_one() -> None:
    """The action is finished, though it sees the second signal: clocks are slowed down for it."""
    code = (
        "import iprt.files.termination; iprt.files.termination.REPEAT_S *= 1e6\n"
        "def finish():\n"
        " print('begun', flush=True)\n"
        " while signal.SIGINT not in signal.sigpending(): time.sleep(0.01)\n"
        " time.sleep(1.0); return 'finished'\n"
        "with at_termination(finish):\n " + READY + " time.sleep(1000)"
    )
    with child_of(START + code) as child:
        assert child.stdout is not None
        for line in ("ready\n", "begun\n"):
            assert child.stdout.readline() == line
            child.send_signal(signal.SIGINT)
        _, stderr = child.communicate(timeout=DEADLINE_S)
    assert (child.returncode, stderr) == (130, "iprt: interrupted; finished\n")


def test_what_is_not_to_be_disturbed_is_finished(tmp_path: Path) -> None:
    path = tmp_path / "whole"
    code = (
        f"with undisturbed(), open({str(path)!r}, 'w') as file:\n "
        + READY
        + " time.sleep(0.3); file.write('all of it')\ntime.sleep(1000)"
    )
    assert ended(code, signal.SIGINT)[0] == 130
    assert path.read_text() == "all of it"


def test_nothing_after_a_block_runs_once_its_action_did() -> None:
    """Else a verb would report what it can no longer find."""
    code = (
        "import threading; gone = threading.Event()\n"
        "def remove(): gone.set(); time.sleep(0.5)\n"
        "with at_termination(remove):\n " + READY + " gone.wait()\n"
        "print('went on', flush=True); os._exit(1)"
    )
    assert ended(code, signal.SIGINT) == (130, "", "iprt: interrupted\n")


@pytest.mark.parametrize("delay_s", [0.0, 0.05, 0.1, 0.2, 0.4])
def test_a_signal_while_modules_are_imported(delay_s: float, scene: Path, tmp_path: Path) -> None:
    """The signals are blocked from before the process starts; so none comes too early."""
    words = ["-m", "iprt", "render", str(scene), "-o", str(tmp_path / "out" / "a.png")]
    words += ["--accumulate", str(2**20)]
    command = f"import os, sys; os.execv(sys.executable, [sys.executable, *{words!r}])"
    with child_of(READY + command) as child:
        assert child.stdout is not None
        child.stdout.readline()
        time.sleep(delay_s)
        child.send_signal(signal.SIGINT)
        stdout, stderr = child.communicate(timeout=120)
    assert (child.returncode, stdout, stderr) == (130, "", "iprt: interrupted\n")
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
@pytest.mark.parametrize("times", [1, 2])
def test_an_interrupt_while_kernels_compile(times: int, scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ["render", str(scene), "-o", str(out / "a.png"), "--size", "24", "16"]
    words += ["--accumulate", "1", "--device", DEVICE]
    code = (
        f"import os; os.environ['POCL_CACHE_DIR'] = {str(tmp_path / 'kernels')!r}\n"
        "from iprt import cli; from iprt.device import compute\n"
        "build = compute.build\n"
        "def marked(*words):\n print('ready', flush=True); return build(*words)\n"
        "compute.build = marked\n"
        f"cli.command({words!r})"
    )
    with child_of(code) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        for _ in range(times):
            time.sleep(0.05)
            child.send_signal(signal.SIGINT)
        _, stderr = child.communicate(timeout=120)
    assert (child.returncode, stderr) == (130, "iprt: interrupted\n")
    assert not out.exists()
