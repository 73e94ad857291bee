"""Requests of other processes, and how running viewers are found."""

from __future__ import annotations

import errno
import json
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.scene.scene import Scene
from iprt.viewer.program.client import RemoteViewer, connect_viewer
from iprt.viewer.program.control import Control
from iprt.viewer.program.listener import LONGEST, listening
from iprt.viewer.program.running import Running, announced, choose, folder, running
from tests.viewer.program.controls import SIZE, controlled
from tests.waiting import DEADLINE_S, ROOT


@pytest.fixture(autouse=True)
def _own_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def control(scene: Scene, device: ComputeDevice) -> Iterator[Control]:
    with controlled(scene, device) as (control, _), listening(control, None, "clip"):
        yield control


@pytest.fixture
def remote(control: Control) -> RemoteViewer:
    return connect_viewer()


def sent(line: bytes) -> bytes:
    """What the newest viewer answers to bytes."""
    with socket.create_connection(("127.0.0.1", choose(None).port), DEADLINE_S) as connection:
        connection.sendall(line)
        try:
            connection.shutdown(socket.SHUT_WR)
            return b"".join(iter(lambda: connection.recv(65536), b""))
        except OSError as error:  # it does not read all of a long line
            if error.errno not in (errno.ECONNRESET, errno.ENOTCONN):
                raise
            return b""


def asked(**request: object) -> bytes:
    known = {"token": choose(None).token, "do": "status", "arguments": [], "named": {}}
    return json.dumps({**known, **request}).encode() + b"\n"


def test_another_process_has_the_same_methods(remote: RemoteViewer, control: Control) -> None:
    remote.place("cube", np.array([0.2, -1.0, -1.4]), rotation=(0.0, 30.0, 0.0))
    remote.set(control._engine.world.settings.model_copy(update={"seed": 7}), {"trace.rays": 2})
    assert control._engine.world.settings.seed == 7
    assert control._engine.world.settings.trace.rays == 2
    np.testing.assert_array_equal(
        remote.picture(SIZE, frames=1), control.picture(SIZE, frames=1), strict=True
    )
    assert remote.status() == control.status()
    assert remote.status()["objects"]["cube"]["rotation"] == [0.0, 30.0, 0.0]


def test_files_are_those_of_the_caller(
    remote: RemoteViewer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = tmp_path / "there"
    there.mkdir()
    with monkeypatch.context() as elsewhere:
        elsewhere.chdir(there)
        named = remote._viewer
        # The viewer runs here and not there: names must be complete when they are sent.
        line = {}
        elsewhere.setattr(RemoteViewer, "_ask", lambda _, *asked: line.update(asked=asked))
        RemoteViewer(named).render(Path("a.png"), SIZE)
    assert line["asked"][1][0] == there / "a.png"


def test_errors_are_the_same(remote: RemoteViewer, tmp_path: Path) -> None:
    with pytest.raises(IprtError, match="no object is named 'pot'; the objects are: cube"):
        remote.place("pot")
    with pytest.raises(IprtError, match="look: yaw: expected less than or equal to 360"):
        remote.look(yaw=500.0)
    with pytest.raises(IprtError, match="got an unexpected keyword argument 'roll'"):
        remote.look(roll=3)  # type: ignore[call-arg]
    with pytest.raises(IprtError, match="object cannot be sent to another process"):
        remote.place("cube", object())  # type: ignore[arg-type]
    (tmp_path / "file").touch()
    with pytest.raises(IprtError, match="is a file, not a folder"):
        remote.render(tmp_path / "file" / "a.png", SIZE)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"\xff\x00\xfe" * 1000,
        b"[" * 100_000,
        b"3\n",
        b"[1, 2, 3]\n",
        b'{"token": 3}\n',
        b"x" * (2 * LONGEST),
        b'{"token": "\\ud800", "do": "quit", "arguments": [], "named": {}}\n',
        b'{"token": "", "do": "quit", "arguments": [], "named": {}}\n',
        b'{"token": "%s", "do": "quit", "arguments": [], "named": {}}\n' % (b"0" * 32),
    ],
    ids=lambda line: repr(line[:24]),
)
def test_strangers_get_no_answer(line: bytes, remote: RemoteViewer) -> None:
    assert sent(line) == b""
    assert remote.status()["scene"] == "clip"


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"do": "explode"}, "no command is named 'explode'; these are: add, "),
        ({"do": "_leave"}, "no command is named '_leave'"),
        ({"do": ["quit"]}, "no command is named"),
        ({"named": []}, "status: expected arguments as a list and an object"),
        ({"arguments": 3}, "status: expected arguments as a list and an object"),
        ({"arguments": [1]}, "status: "),
        ({"named": {"self": 1}}, "status: "),
        ({"do": "seek", "arguments": ["x"]}, "seek: frame: expected a valid integer"),
        ({"do": "set", "arguments": [{"trace": {"rays": "x"}}]}, "trace.rays"),
        ({"do": "place", "arguments": ["cube", [1e400, 0, 0]]}, "expected a finite number"),
    ],
)
def test_bad_requests_are_told_in_a_line(
    request_: dict[str, object], words: str, remote: RemoteViewer
) -> None:
    answer = json.loads(sent(asked(**request_)))
    (line,) = answer["error"]
    assert words in line
    assert "defect" not in line
    assert answer["exit_code"] == 2
    assert remote.status()["scene"] == "clip"


def test_only_the_user_can_read_the_token(control: Control) -> None:
    (file,) = folder().iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert stat.S_IMODE(folder().stat().st_mode) == 0o700


def test_viewers_are_found_by_age_and_port() -> None:
    with pytest.raises(IprtError, match="no viewer is running; start one with `iprt view SCENE`"):
        connect_viewer()
    old, new = Running(5001, "a", "/old", 8080), Running(5002, "b", "/new", None)
    with announced(old), announced(new):
        assert running() == [new, old]
        assert choose(None) == choose(5002) == new
        assert choose(5001) == choose(8080) == old
        with pytest.raises(IprtError, match=r"at port 9; these are: /new \(port 5002, in a window"):
            choose(9)
    assert list(folder().iterdir()) == []


def test_a_killed_viewer_leaves_nothing_that_matters() -> None:
    """Its file is removed, and one that is no viewer's does no harm."""
    program = (
        "from iprt.viewer.program.running import *\n"
        "with announced(Running(5003, 'c', '/killed', None)):\n"
        "    print(flush=True); input()\n"
    )
    killed = subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert killed.stdout is not None
    killed.stdout.readline()
    assert [viewer.scene for viewer in running()] == ["/killed"]
    killed.send_signal(signal.SIGKILL)
    killed.communicate(timeout=DEADLINE_S)
    assert len(list(folder().iterdir())) == 1
    assert running() == []
    assert list(folder().iterdir()) == []
    (folder() / f"{socket.gethostname()}-7.json").write_text("nonsense")
    assert running() == []


def test_a_folder_that_cannot_be_written_is_only_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "state").touch()
    with announced(Running(5004, "d", "/unseen", None)):
        assert running() == []
    assert "`iprt remote` cannot find this viewer" in caplog.text


def test_a_viewer_that_ended_meanwhile(control: Control) -> None:
    gone = RemoteViewer(Running(1, "", "clip", None))
    with pytest.raises(IprtError, match=r"the viewer of clip .* has ended"):
        gone.status()
