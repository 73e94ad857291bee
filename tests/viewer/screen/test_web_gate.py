"""Who may come to the web viewer, and what its server says when it cannot start."""

from __future__ import annotations

import http.client
import signal
import socket
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import pytest

from iprt.errors import IprtError
from iprt.geometry.camera import View
from tests.clips import write_clip
from tests.waiting import DEADLINE_S

viser = pytest.importorskip("viser", reason="needs the extra `view`: ./run screen")

from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402
from websockets.sync.client import connect  # noqa: E402
from websockets.sync.server import ServerConnection  # noqa: E402
from websockets.sync.server import serve as listen_and_echo  # noqa: E402

from iprt.viewer.web import server  # noqa: E402
from iprt.viewer.web.browser import Browser, Start  # noqa: E402
from iprt.viewer.web.gate import Gate, is_loopback, new_token, require_token  # noqa: E402

pytestmark = pytest.mark.screen

TOKEN = "a-token-of_27-characters-1"
PAGE = b"<html>the page</html>"
SUBPROTOCOL = [f"viser-v{viser.__version__}"]


@pytest.fixture(scope="module")
def guarded() -> Iterator[int]:
    """Port of a viewer that asks for the token."""
    yield from _serving(TOKEN)


@pytest.fixture(scope="module")
def local() -> Iterator[int]:
    """Port of a viewer for this machine alone."""
    yield from _serving(None)


def _serving(token: str | None) -> Iterator[int]:
    listening = server.listen("127.0.0.1", 0)
    port = listening.getsockname()[1]
    behind = server.Viser("test")
    relay = server.Relay(listening, Gate(PAGE, port, token, new_token()), behind.get_port())
    yield port
    relay.stop()
    behind.stop()


def get(port: int, path: str = "/", **headers: str) -> tuple[int, http.client.HTTPMessage, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=DEADLINE_S)
    connection.request("GET", path, headers={name.title(): text for name, text in headers.items()})
    answer = connection.getresponse()
    return answer.status, answer.headers, answer.read()


def opens(port: int, path: str = "/", **headers: str) -> int:
    """101, or the status with which a WebSocket is refused."""
    named = {name.title(): text for name, text in headers.items()}
    host = named.pop("Host", f"127.0.0.1:{port}")
    with socket.create_connection(("127.0.0.1", port)) as link:
        try:
            with connect(
                f"ws://{host}{path}", sock=link, subprotocols=SUBPROTOCOL, additional_headers=named
            ):
                return 101
        except InvalidStatus as refused:
            return refused.response.status_code


def test_nothing_without_the_token(guarded: int) -> None:
    wrong = f"/?token={TOKEN[:-1]}2"
    for path in ("/", wrong, "/?token=", "/index.html", "/?TOKEN=" + TOKEN):
        status, _, body = get(guarded, path)
        assert (status, PAGE in body) == (401, False), path
        assert opens(guarded, path) == 401, path
    assert get(guarded, cookie=f"iprt-{guarded}={TOKEN}x")[0] == 401
    assert get(guarded, cookie=f"iprt-{guarded + 1}={TOKEN}")[0] == 401
    assert opens(guarded, cookie=f"iprt-{guarded}=") == 401


def test_the_token_becomes_a_cookie(guarded: int) -> None:
    status, headers, _ = get(guarded, f"/?token={TOKEN}")
    assert (status, headers["Location"]) == (303, "/")
    cookie, *flags = headers["Set-Cookie"].split("; ")
    assert {"HttpOnly", "SameSite=Lax"} <= set(flags)
    status, headers, body = get(guarded, cookie=f"other=1; {cookie}")
    assert (status, body) == (200, PAGE)
    assert headers["Cache-Control"] == "no-store"
    assert opens(guarded, cookie=cookie) == 101
    assert opens(guarded, f"/?token={TOKEN}") == 101
    assert get(guarded, "/other", cookie=cookie)[0] == 404


def test_pages_can_ask_whether_it_runs(guarded: int, local: int) -> None:
    """The answer stays, and differs from that of any other run."""
    assert get(guarded, "/alive")[0] == 401
    status, _, mine = get(guarded, f"/alive?token={TOKEN}")
    assert (status, get(guarded, f"/alive?token={TOKEN}")[2]) == (200, mine)
    assert get(local, "/alive")[2] != mine


def test_pages_of_elsewhere_are_refused(local: int, guarded: int) -> None:
    """One whose name was made to mean this machine, and one that opens our WebSocket."""
    assert get(local)[2] == PAGE
    assert get(local, host=f"evil.example:{local}")[0] == 403
    assert get(local, host="localhost:9000")[0] == 200  # another port, through ssh -L
    assert opens(local, host=f"evil.example:{local}") == 403
    assert opens(local, origin=f"http://127.0.0.1:{local}") == 101
    assert opens(local, origin="http://evil.example") == 403
    assert opens(local, origin=f"http://localhost:{local}") == 403
    assert opens(guarded, f"/?token={TOKEN}", origin="http://evil.example") == 403


def test_names_of_this_machine() -> None:
    for name in ("localhost", "LocalHost.", "127.0.0.1", "127.8.0.1", "::1"):
        assert is_loopback(name), name
    for name in ("", "0.0.0.0", "::", "10.0.0.1", "localhost.evil.example", "127.0.0.1.nip.io"):
        assert not is_loopback(name), name


def test_tokens() -> None:
    assert require_token(new_token()) != new_token()
    for bad in ("", "short", "with spaces in it", "täglich-brot-und", "semicolon;in-it"):
        with pytest.raises(IprtError, match="at least 12 characters"):
            require_token(bad)


def test_addresses_that_cannot_be_had(local: int) -> None:
    with pytest.raises(IprtError, match=f"--port {local}: the port is taken"):
        server.listen("127.0.0.1", local)
    with pytest.raises(IprtError, match="no such address"):
        server.listen("nowhere.invalid", 0)
    with pytest.raises(IprtError, match="does not have the address"):
        server.listen("192.0.2.1", 0)


def test_nobody_can_share_it_with_the_world(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda *_, **__: asked.append(1))
    behind = server.Viser("test")
    assert behind.request_share_url() is None
    assert asked == []
    behind.stop()


def is_served(answer: Callable[..., str | None], monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether a page is shown something whose browser answers so when asked for its run."""
    served: list[Browser] = []
    monkeypatch.setattr(Browser, "_serve", lambda browser: served.append(browser))
    viewport = SimpleNamespace(close=lambda: None)
    monkeypatch.setattr("iprt.viewer.web.browser.Viewport", lambda *_, **__: viewport)
    camera = SimpleNamespace(wxyz=(1, 0, 0, 0), fov=1.0, image_width=8, image_height=8)
    storage = SimpleNamespace(get_item=answer)
    client: Any = SimpleNamespace(client_id=0, camera=camera, local_storage=storage)
    engine: Any = None
    browser = Browser(engine, client, Start(View(8, 8)), Path(), "this run's")
    browser.join(DEADLINE_S)
    return served == [browser]


@pytest.mark.parametrize("known", [None, "", "another run's", "this run's"])
def test_who_reaches_viser_beside_the_gate_is_shown_nothing(
    known: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only a page that came through it knows the run."""
    assert is_served(lambda _, timeout: known, monkeypatch) == (known == "this run's")


def test_a_page_that_was_asked_too_early_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """While a page is made, it loses what is sent to it."""
    asked: list[float] = []

    def answer(_: str, timeout: float) -> str:
        asked.append(timeout)
        if len(asked) < 3:
            raise TimeoutError
        return "this run's"

    assert is_served(answer, monkeypatch)
    assert len(asked) == 3
    assert max(asked) < 10.0


def test_messages_pass_in_both_ways(local: int) -> None:
    """Whole and in order, however large; and each end learns that the other one is gone."""
    received: list[bytes] = []
    large = bytes(range(256)) * (1 << 16)

    def echo(connection: ServerConnection) -> None:
        for message in connection:
            received.append(bytes(message))
            connection.send(bytes(reversed(message)))

    with listen_and_echo(echo, "127.0.0.1", 0, max_size=None) as behind:
        thread = threading.Thread(target=behind.serve_forever)
        thread.start()
        listening = server.listen("127.0.0.1", 0)
        port = listening.getsockname()[1]
        gate = Gate(PAGE, port, None, new_token())
        relay = server.Relay(listening, gate, behind.socket.getsockname()[1])
        address = f"ws://127.0.0.1:{port}"
        with connect(address, max_size=None, compression=None) as one, connect(address) as other:
            for message in (b"1", large, b"", b"2"):
                one.send(message)
                other.send(b"another's")
                assert one.recv(DEADLINE_S) == bytes(reversed(message))
                assert other.recv(DEADLINE_S) == b"s'rehtona"
            relay.stop()
            with pytest.raises(ConnectionClosed):
                one.recv(DEADLINE_S)
        behind.shutdown()
        thread.join()
    assert [message for message in received if message != b"another's"] == [b"1", large, b"", b"2"]


def test_it_says_where_it_is_and_ends_by_ctrl_c(tmp_path: Path) -> None:
    """The address is wide and has a token that was made; nothing else is printed."""
    scene = write_clip(tmp_path / "clip", 1)
    program = textwrap.dedent(
        f"""
        import signal
        from pathlib import Path
        signal.signal(signal.SIGINT, signal.default_int_handler)
        from iprt.device.compute import ComputeDevice
        from iprt.scene.scene import Scene
        from iprt.viewer.engine import Engine
        from iprt.viewer.web import serve
        scene = Scene.open(Path({str(scene)!r}))
        with Engine(scene, lambda: None) as engine:
            serve(engine, scene.views["ahead"].view, host="0.0.0.0", port=0,
                  ready=lambda a: print(a.url, a.local, flush=True))
        print("ended")
        """
    )
    running = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stdout is not None
    url, is_local = running.stdout.readline().split()
    parts = urlsplit(url)
    assert parts.port is not None
    assert is_local == "False"
    assert get(parts.port)[0] == 401
    assert get(parts.port, f"/?{parts.query}")[0] == 303
    running.send_signal(signal.SIGINT)
    out, errors = running.communicate(timeout=DEADLINE_S)
    assert (running.returncode, out, errors) == (0, "ended\n", "")
