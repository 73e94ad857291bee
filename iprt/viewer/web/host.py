"""The browsers of one engine."""

from __future__ import annotations

import socket
import tempfile
import threading
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from iprt.files.termination import at_termination
from iprt.viewer.engine import Engine
from iprt.viewer.web.browser import Browser
from iprt.viewer.web.camera import position_of
from iprt.viewer.web.picture_plane import FAR_M
from iprt.viewer.web.server import Viser, require_free, write_site
from iprt.viewer.windows import Start, Windows

LEAVING_S = 2.0
"""Longest wait for browsers' threads to end."""
FOV_DEG = 70.0
"""Initial vertical field of view if the requested view is a whole panorama."""


class Host(Windows):
    """A server of browsers, from its creation until `close`; see `iprt.viewer.web.serve`.

    Attributes
    ----------
    port : int
    """

    port: int

    def __init__(self, engine: Engine, start: Start, port: int) -> None:
        # Browsers may leave at any moment; messages on their way to them are dropped.
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
        self._engine = engine
        self._browsers: dict[int, Browser] = {}
        self._lock = threading.Lock()
        self._ended = threading.Event()
        require_free(port)
        self._folder = tempfile.TemporaryDirectory(prefix="iprt-")
        self._uploads, site = Path(self._folder.name, "uploads"), Path(self._folder.name, "site")
        self._uploads.mkdir()
        site.mkdir()
        write_site(site)
        self._viser = Viser(port, f"iprt {engine.scene.name}", site)
        self.begin(start)
        self._set_up()
        self.port = self._viser.get_port()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Address for browsers of this machine."""
        return f"http://localhost:{self.port}/"

    @property
    def ssh(self) -> str:
        """The command that makes `url` reachable on another machine."""
        return f"ssh -L {self.port}:localhost:{self.port} {socket.gethostname()}"

    @property
    def start(self) -> Start:
        """The state in which later browsers begin; a whole panorama becomes a perspective view."""
        return self._start

    def begin(self, start: Start) -> None:
        """Let later browsers begin in this state."""
        view = start.view
        if view.projection == "equirect":
            view = replace(view, projection="perspective", fov_y_deg=FOV_DEG)
        self._start = replace(start, view=view)
        camera = self._viser.initial_camera
        camera.position, camera.look_at = position_of(view), np.zeros(3)
        camera.fov, camera.far = float(np.deg2rad(view.fov_y_deg)), FAR_M

    @property
    def states(self) -> tuple[Browser, ...]:
        """The connected browsers."""
        return self.browsers

    @property
    def browsers(self) -> tuple[Browser, ...]:
        """Connected browsers."""
        with self._lock:
            return tuple(self._browsers.values())

    def wait(self) -> None:
        """Wait until it is closed."""
        # In turns, because some systems cannot interrupt a wait without a timeout.
        # Uploaded meshes are kept with the edits before they are deleted.
        with at_termination(self._folder.cleanup), at_termination(self._engine.autosaver.keep):
            while not self._ended.wait(0.5):
                pass

    def leave(self) -> None:
        """Let `wait` return, and discard unsaved edits."""
        self._engine.autosaver.abandon()
        self._ended.set()

    def close(self) -> None:
        """End all connections and threads."""
        self._ended.set()
        browsers = self.browsers
        for browser in browsers:
            browser.close()
        for browser in browsers:
            browser.join(LEAVING_S)
        self._viser.stop()
        self._engine.autosaver.keep()  # with uploaded meshes
        self._folder.cleanup()

    def _set_up(self) -> None:
        viser = self._viser
        viser.scene.set_up_direction("+y")
        viser.scene.world_axes.visible = False
        viser.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, control_width="medium"
        )

        async def came(client: Any) -> None:
            if not viser.is_local(client):
                client.add_notification(
                    "", "Open this viewer as localhost.", auto_close_seconds=None
                )
                return
            with self._lock:
                if not self._ended.is_set():
                    self._browsers[client.client_id] = Browser(
                        self._engine, client, self._start, self._uploads
                    )

        async def went(client: Any) -> None:
            with self._lock:
                browser = self._browsers.pop(client.client_id, None)
            if browser is not None:
                browser.close()

        viser.on_client_connect(came)
        viser.on_client_disconnect(went)
