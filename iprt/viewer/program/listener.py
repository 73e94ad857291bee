"""The port at which a running viewer takes requests of other processes.

A connection carries one request: a line of JSON with the token, the name of a method of `Control`
and its arguments. The answer is a line of JSON with the result or the error. The pixels of a
picture follow it.
"""

from __future__ import annotations

import hmac
import json
import logging
import secrets
import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.viewer.program.checked import METHODS
from iprt.viewer.program.control import Control
from iprt.viewer.program.running import Running, announced

LOG = logging.getLogger("iprt.viewer")
HOST = "127.0.0.1"
LONGEST = 1 << 20
"""Limit for the bytes of a request."""
SILENCE_S = 10.0
"""Time after which a silent connection is closed."""
LEAVING_S = 1.0
"""Longest wait for the last answer."""


class Listener(socketserver.ThreadingTCPServer):
    """A server that takes requests from this machine, one after another.

    Parameters
    ----------
    control : Control

    Attributes
    ----------
    token : str
        Requests without it are dropped.
    turn : threading.Lock
        Held by the request under way.
    """

    daemon_threads, block_on_close = True, False

    def __init__(self, control: Control) -> None:
        self.control, self.token = control, secrets.token_hex(16)
        self.turn = threading.Lock()
        super().__init__((HOST, 0), _Handler)

    @property
    def port(self) -> int:
        """The port at which it listens."""
        return int(self.server_address[1])

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Log that a connection failed, which does not concern the viewer's user."""
        LOG.debug("a connection failed", exc_info=True)


class _Handler(socketserver.StreamRequestHandler):
    server: Listener
    timeout = SILENCE_S

    def handle(self) -> None:
        try:
            request = json.loads(self.rfile.readline(LONGEST))
            given = str(request["token"]).encode(errors="replace")
            asked = request["do"], request["arguments"], request["named"]
        except (ValueError, LookupError, TypeError, RecursionError):
            return
        if not hmac.compare_digest(given, self.server.token.encode()):
            return
        with self.server.turn:
            answer, pixels = _answered(self.server.control, *asked)
            self.wfile.write(json.dumps(answer).encode() + b"\n" + pixels)


def _answered(
    control: Control, name: Any, positional: Any, named: Any
) -> tuple[dict[str, Any], bytes]:
    """Return the answer to a request, and the pixels that follow it."""
    try:
        if not isinstance(name, str) or name not in METHODS:
            known = ", ".join(sorted(METHODS))
            raise IprtError(f"no command is named '{printable(str(name))}'; these are: {known}")
        if not isinstance(positional, list) or not isinstance(named, dict):
            raise IprtError(f"{name}: expected arguments as a list and an object")
        result = getattr(control, name)(*positional, **named)
    except IprtError as error:
        return {"error": error.lines, "exit_code": error.exit_code}, b""
    except Exception as error:
        LOG.error("a defect of iprt", exc_info=error)
        text = f"a defect of iprt: {type(error).__name__}: {error}"
        return {"error": [text], "exit_code": IprtError.exit_code}, b""
    if isinstance(result, np.ndarray):
        return {"shape": result.shape}, result.astype("<f4").tobytes()
    return {"result": result}, b""


@contextmanager
def listening(control: Control, web: int | None, scene: str) -> Iterator[None]:
    """Take requests of other processes of the user during the block.

    Parameters
    ----------
    control : Control
    web : int or None
        Port of browsers; None for a window.
    scene : str
        Path of the scene.
    """
    with Listener(control) as server:
        threading.Thread(target=server.serve_forever, name="iprt remote", daemon=True).start()
        try:
            with announced(Running(server.port, server.token, scene, web)):
                yield
        finally:
            server.shutdown()
            server.turn.acquire(timeout=LEAVING_S)  # the last answer is on its way
