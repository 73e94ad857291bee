"""viser on this machine alone, and before it the server that browsers reach, with the gate."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import io
import logging
import socket
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from importlib.resources import files
from itertools import permutations

import viser
from websockets.asyncio.client import connect
from websockets.asyncio.connection import Connection
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from iprt.errors import IprtError
from iprt.viewer.web.gate import Gate

ALIVE_S = 10.0
"""Seconds between two pings of a browser, and until it must have answered one."""
STOP_S = 5.0
"""Longest wait for connections to be closed."""
MAX_BYTES = 50 << 20
"""Size of a browser's message: as viser has it."""
RUN = "iprt-run"
"""Key of the browser's local storage where pages that came through the gate have its `run`."""


def listen(host: str, port: int) -> socket.socket:
    """A socket that is bound; port 0: any that is free.

    Raises
    ------
    IprtError
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM
        )[0]
    except (OSError, UnicodeError) as error:
        raise IprtError(f"--host {host}: no such address; 127.0.0.1 is this machine") from error
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen()
    except (OSError, OverflowError) as error:
        listening.close()
        raise IprtError(f"--host {host} --port {port}: {_why(error)}") from error
    return listening


def _why(error: OSError | OverflowError) -> str:
    if isinstance(error, OverflowError):
        return "expected 0 to 65535"
    if error.errno == errno.EADDRINUSE:
        return "the port is taken; choose another, or 0 for any that is free"
    if error.errno == errno.EACCES:
        return "not permitted; choose a port from 1024 on"
    if error.errno == errno.EADDRNOTAVAIL:
        return "this machine does not have the address; 127.0.0.1 and 0.0.0.0 it has"
    return str(error.strerror)


def page(port: int, run: str) -> bytes:
    """viser's page, from its port, with our scripts in it and what `Host` knows its clients by."""
    connection = HTTPConnection("127.0.0.1", port)
    connection.request("GET", "/")
    html = connection.getresponse().read().decode()
    connection.close()
    own = files("iprt.viewer.web")
    scripts = [own.joinpath(name).read_text("utf-8") for name in ("page.js", "alive.js")]
    head, tag, rest = html.partition("</head>")
    title = head.replace("<title>Viser</title>", "<title>iprt</title>")
    known = f'const IPRT_RUN = "{run}";\nlocalStorage.setItem("viser-user:{RUN}", IPRT_RUN);\n'
    inserted = "".join(f"<script>\n{script}</script>" for script in (known, *scripts))
    return f"{title}{inserted}{tag}{rest}".encode()


class Viser(viser.ViserServer):  # type: ignore[misc]  # viser is not typed here
    """viser on a loopback port of its own, which only `Relay` is to use."""

    def __init__(self, label: str) -> None:
        with _silent():
            super().__init__("127.0.0.1", 0, label, verbose=False)

    def request_share_url(self, verbose: bool = True) -> None:
        """Do nothing: any client can ask for it, and it would show the scene to the world."""

    def stop(self) -> None:
        """End it, and all connections."""
        with _silent():
            super().stop()


class Relay:
    """Serves a gate's answers, and passes the WebSockets that it lets through on to viser.

    Parameters
    ----------
    listening : socket.socket
        Closed in the end.
    gate : Gate
    port : int
        viser's, on this machine.
    """

    def __init__(self, listening: socket.socket, gate: Gate, port: int) -> None:
        self._listening, self._gate, self._port = listening, gate, port
        self._loop, self._stopped = asyncio.new_event_loop(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="iprt relay", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End all connections."""
        self._loop.call_soon_threadsafe(self._stopped.set)
        self._thread.join(STOP_S)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        quiet = logging.getLogger("iprt.viewer.web.socket")
        quiet.setLevel(logging.CRITICAL)  # ports that are probed are no news
        async with serve(
            self._pass_on,
            sock=self._listening,
            process_request=self._gate.answer,
            select_subprotocol=lambda _, offered: offered[0] if offered else None,
            logger=quiet,
            compression=None,  # pictures are compressed already
            max_size=MAX_BYTES,
            ping_interval=ALIVE_S,
            ping_timeout=ALIVE_S,
        ):
            await self._stopped.wait()

    async def _pass_on(self, browser: ServerConnection) -> None:
        offered = None if browser.subprotocol is None else [browser.subprotocol]
        async with connect(
            f"ws://127.0.0.1:{self._port}",
            subprotocols=offered,
            compression=None,
            max_size=None,
            ping_interval=None,
            proxy=None,
        ) as server:
            ways = [asyncio.create_task(_copy(a, b)) for a, b in permutations((browser, server))]
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            # As viser's page says why when its version is not the server's.
            if server.close_code is not None:
                await browser.close(server.close_code, server.close_reason or "")


async def _copy(source: Connection, target: Connection) -> None:
    """Pass messages on until either end is gone. One that is slow slows the other."""
    with contextlib.suppress(ConnectionClosed):
        async for message in source:
            await target.send(message)


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """viser prints on the standard output in any case."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
