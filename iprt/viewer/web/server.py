"""viser on a loopback port, with our scripts in its page."""

from __future__ import annotations

import contextlib
import io
import logging
import secrets
import socket
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import viser

from iprt.errors import IprtError

HOST = "127.0.0.1"
STYLE = "<style>[role=tab] { padding-inline: 0.5em !important }</style>"
"""So that all tabs fit beside each other."""
LOCAL_NAMES = ("localhost", HOST, "::1")


def require_free(port: int) -> None:
    """Raise IprtError if no server can listen at a loopback port; viser would take another one."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            advice = "choose another, or 0 for any that is free"
            raise IprtError(f"--port {port}: {error.strerror}; {advice}") from error


def write_site(folder: Path) -> None:
    """Write the files that are served: viser's page with our scripts, and the name of this run.

    Pages ask for `alive` to learn whether the same server still runs; see `alive.js`.
    """
    run = secrets.token_hex(8)
    built = Path(viser.__file__).parent / "client" / "build" / "index.html"
    head, tag, rest = built.read_text("utf-8").partition("</head>")
    title = head.replace("<title>Viser</title>", "<title>iprt</title>")
    own = files("iprt.viewer.web")
    scripts = [own.joinpath(name).read_text("utf-8") for name in ("page.js", "alive.js")]
    inserted = "".join(
        f"<script>\n{script}</script>" for script in (f'const IPRT_RUN = "{run}";\n', *scripts)
    )
    (folder / "index.html").write_text(f"{title}{STYLE}{inserted}{tag}{rest}", "utf-8")
    (folder / "alive").write_text(run, "utf-8")


class Viser(viser.ViserServer):  # type: ignore[misc]  # viser is not typed here
    """A viser server that only this machine reaches, and that serves the files of a folder.

    Parameters
    ----------
    port : int
        0 for any free port.
    label : str
        Title of the panel.
    site : Path
        Folder of `write_site`.
    """

    def __init__(self, port: int, label: str, site: Path) -> None:
        # websockets logs each connection without a request, such as a port scan.
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
        self._site = site
        with _silent():
            super().__init__(HOST, port, label, verbose=False)

    @property
    def _websock_server(self) -> Any:
        return self._server

    @_websock_server.setter
    def _websock_server(self, server: Any) -> None:
        # viser has no parameter for the folder; it reads this attribute when it starts.
        server._http_server_root = self._site
        self._server = server

    def is_local(self, client: viser.ClientHandle) -> bool:
        """Return True if a client is our page, or a program other than a browser.

        Any web page may open a WebSocket to this machine; its browser sends the page's origin.
        """
        headers = self._server._live_connections[client.client_id].request.headers
        origins = headers.get_all("Origin")
        return all(urlsplit(origin).hostname in LOCAL_NAMES for origin in origins)

    def request_share_url(self, verbose: bool = True) -> None:
        """Do nothing: any client can call it, and it would publish the scene on the internet."""

    def stop(self) -> None:
        """End the server and all connections."""
        with _silent():
            super().stop()


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Discard the standard output of viser."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
