"""viser's server behind our gate: on a socket of ours, silent, and without its way to the net."""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import socket
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any
from unittest import mock

import viser
import websockets.asyncio.server

from iprt.errors import IprtError
from iprt.viewer.web.gate import Gate

ALIVE_S = 10.0
"""A client is asked so often whether it is still there, and has so long to answer."""


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


def page() -> bytes:
    """viser's page with our scripts in it."""
    html = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text("utf-8")
    own = files("iprt.viewer.web")
    scripts = [own.joinpath(name).read_text("utf-8") for name in ("page.js", "alive.js")]
    head, tag, rest = html.partition("</head>")
    title = head.replace("<title>Viser</title>", "<title>iprt</title>")
    inserted = "".join(f"<script>\n{script}</script>" for script in scripts)
    return f"{title}{inserted}{tag}{rest}".encode()


def start(listening: socket.socket, gate: Gate, label: str) -> Any:
    """A `viser.ViserServer` all of whose requests pass the gate.

    Raises
    ------
    IprtError
        This version of viser serves in another way, which the gate would not guard.
    """
    made: list[object] = []
    serve = websockets.asyncio.server.serve

    def guarded(handler: Any, _host: str, _port: int, **options: Any) -> Any:
        made.append(handler)
        quiet = logging.getLogger("iprt.viewer.web.socket")
        quiet.setLevel(logging.CRITICAL)  # ports that are probed are no news
        options |= {"process_request": gate.answer, "logger": quiet, "sock": listening}
        options |= {"ping_interval": ALIVE_S, "ping_timeout": ALIVE_S}
        return serve(handler, **options)

    with _silent(), mock.patch.object(websockets.asyncio.server, "serve", guarded):
        server = viser.ViserServer("127.0.0.1", gate.port, label, verbose=False)
    if len(made) != 1 or server.get_port() != gate.port:
        with _silent():
            server.stop()
        listening.close()
        raise IprtError(f"viser {viser.__version__} is not known here; pip install 'iprt[view]'")
    # Any client can ask for this, which would show the scene by way of viser's own server.
    server.request_share_url = lambda *_, **__: None
    return server


def stop(server: Any) -> None:
    """End it, and all connections."""
    with _silent():
        server.stop()


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """viser tells of itself on the standard output, in any case."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
