"""All browsers of one engine."""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path
from socket import gethostname
from typing import Any, Self

import numpy as np

from iprt.files.termination import at_termination
from iprt.viewer.engine import Engine
from iprt.viewer.web import server
from iprt.viewer.web.browser import Browser, Start
from iprt.viewer.web.camera import position_of
from iprt.viewer.web.gate import Address, Gate, is_loopback, new_token, require_token

LEAVING_S = 2.0
"""Longest wait for browsers' threads to end."""


class Host:
    """Serves browsers from when it is made until it is closed. See `iprt.viewer.web.serve`.

    Attributes
    ----------
    address : Address
    """

    def __init__(
        self,
        engine: Engine,
        start: Start,
        *,
        host: str,
        port: int,
        token: str | None,
    ) -> None:
        self._engine, self._start = engine, start
        self._browsers: dict[int, Browser] = {}
        self._lock = threading.Lock()
        self._uploads = tempfile.TemporaryDirectory(prefix="iprt-")
        self._ended = threading.Event()
        if token is not None:
            require_token(token)
        listening = server.listen(host, port)
        bound, port = listening.getsockname()[:2]
        local = is_loopback(bound)
        if token is None and not local:
            token = new_token()
        self._run = new_token()
        self._viser = server.Viser(f"iprt {engine.scene.name}")
        self._set_up()
        behind = self._viser.get_port()
        gate = Gate(server.page(behind, self._run), port, token, self._run)
        self._relay = server.Relay(listening, gate, behind)
        self.address = Address(_url(bound, port, token), port, local)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def browsers(self) -> tuple[Browser, ...]:
        """Browsers that are connected."""
        with self._lock:
            return tuple(self._browsers.values())

    def wait(self) -> None:
        """Until it is closed."""
        # In turns, as a wait without end cannot be interrupted on some systems.
        with at_termination(self._uploads.cleanup):
            while not self._ended.wait(0.5):
                pass

    def close(self) -> None:
        """End all connections and threads."""
        self._ended.set()
        browsers = self.browsers
        for browser in browsers:
            browser.close()
        for browser in browsers:
            browser.join(LEAVING_S)
        self._relay.stop()
        self._viser.stop()
        self._uploads.cleanup()

    def _set_up(self) -> None:
        viser, view = self._viser, self._start.view
        viser.scene.set_up_direction("+y")
        viser.scene.world_axes.visible = False
        viser.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, control_width="medium"
        )
        camera = viser.initial_camera
        camera.position, camera.look_at = position_of(view), np.zeros(3)
        camera.fov = float(np.deg2rad(view.fov_y_deg))

        async def came(client: Any) -> None:
            with self._lock:
                if not self._ended.is_set():
                    self._browsers[client.client_id] = Browser(
                        self._engine, client, self._start, Path(self._uploads.name), self._run
                    )

        async def went(client: Any) -> None:
            with self._lock:
                browser = self._browsers.pop(client.client_id, None)
            if browser is not None:
                browser.close()

        viser.on_client_connect(came)
        viser.on_client_disconnect(went)


def _url(bound: str, port: int, token: str | None) -> str:
    if is_loopback(bound):
        name = "localhost"
    elif bound in ("0.0.0.0", "::"):
        name = gethostname()
    else:
        name = f"[{bound}]" if ":" in bound else bound
    query = "" if token is None else f"?token={token}"
    return f"http://{name}:{port}/{query}"
