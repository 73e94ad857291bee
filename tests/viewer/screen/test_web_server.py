"""Who may see the web viewer, and what its server says when it cannot start."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from queue import Queue
from types import SimpleNamespace
from typing import Any
from urllib.request import urlopen

import pytest
import viser

from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.viewer.web.host import Host
from iprt.viewer.web.server import Viser, require_free
from iprt.viewer.windows import Start
from tests.clips import write_clip
from tests.viewer.screen.web import connected
from tests.waiting import DEADLINE_S


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Queue[int]]:
    """Numbers of the clients that get a window; they are shown nothing."""
    clients: Queue[int] = Queue()

    def browser(_engine: object, client: Any, *_: object) -> Any:
        clients.put(client.client_id)
        return SimpleNamespace(close=lambda: None, join=lambda _timeout_s: None)

    monkeypatch.setattr("iprt.viewer.web.host.Browser", browser)
    return clients


def hosting() -> Host:
    autosaver = SimpleNamespace(keep=lambda: None)
    engine: Any = SimpleNamespace(scene=SimpleNamespace(name="test"), autosaver=autosaver)
    return Host(engine, Start(View(8, 8)), 0)


def get(host: Host, path: str = "") -> str:
    with urlopen(host.url + path, timeout=DEADLINE_S) as answer:
        return str(answer.read().decode())


def test_pages_of_elsewhere_see_nothing(
    served: Queue[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any page may open a WebSocket here, also one whose name was made to mean this machine."""
    judged: Queue[bool] = Queue()
    is_local = Viser.is_local

    def judge(server: Viser, client: Any) -> bool:
        local = is_local(server, client)
        judged.put(local)
        return local

    monkeypatch.setattr(Viser, "is_local", judge)
    with hosting() as host:
        origins = {
            "http://evil.example": False,
            f"http://evil.example:{host.port}": False,
            "null": False,
            "http://127.0.0.1.evil.example": False,
            None: True,  # a program
            f"http://localhost:{host.port}": True,
            "http://localhost:9000": True,  # through ssh -L
            f"http://127.0.0.1:{host.port}": True,
            f"http://[::1]:{host.port}": True,
        }
        for number, (origin, local) in enumerate(origins.items()):
            with connected(host.url, origin):
                assert judged.get(timeout=DEADLINE_S) == local, origin
                if local:
                    assert served.get(timeout=DEADLINE_S) == number, origin
        assert served.empty()


def test_the_page_has_our_scripts_and_knows_its_run(served: Queue[int]) -> None:
    """The run's name stays, and differs from that of any other run."""
    with hosting() as one, hosting() as other:
        page, run = get(one), get(one, "alive")
        assert "<title>iprt</title>" in page
        assert f'const IPRT_RUN = "{run}";' in page
        assert "iprt-gone" in page  # alive.js
        assert "AGAIN_MS" in page  # page.js
        assert get(one, "alive") == run != get(other, "alive")


def test_a_port_that_is_taken() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(IprtError, match=f"--port {port}: Address already in use"):
            require_free(port)
    require_free(port)


def test_nobody_can_share_it_with_the_world(
    served: Queue[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda *_, **__: asked.append(1))
    with hosting() as host:
        assert host._viser.request_share_url() is None
    assert asked == []


def test_it_says_where_it_is_and_ends_by_ctrl_c(tmp_path: Path) -> None:
    """Only this machine's own name leads there; nothing else is printed."""
    scene = write_clip(tmp_path / "clip", 1)
    command = [sys.executable, "-m", "iprt", "view", str(scene), "--web", "--port", "0"]
    running = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Shells let programs in the background ignore Ctrl+C.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert running.stdout is not None
    found = re.fullmatch(r"open http://localhost:(\d+)/ .*\n", running.stdout.readline())
    assert found is not None
    port = int(found[1])
    assert f"ssh -L {port}:localhost:{port} " in running.stdout.readline()
    socket.create_connection(("127.0.0.1", port), DEADLINE_S).close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", port), DEADLINE_S)
    running.send_signal(signal.SIGINT)
    out, errors = running.communicate(timeout=DEADLINE_S)
    assert (running.returncode, out, errors) == (130, "", "iprt: interrupted\n")
