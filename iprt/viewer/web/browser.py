"""The session of one browser: camera, picture and panels, on its own thread."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from iprt.errors import IprtError
from iprt.viewer.engine import Engine
from iprt.viewer.viewport import Viewport
from iprt.viewer.web.around import Around
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.camera import look_of
from iprt.viewer.web.divider import Divider
from iprt.viewer.web.gizmo import ObjectGizmo, SunGizmo
from iprt.viewer.web.leader import Leader, same
from iprt.viewer.web.motion_path import MotionPath
from iprt.viewer.web.panels import Panels
from iprt.viewer.web.picture import PictureSender
from iprt.viewer.windows import Start

LOG = logging.getLogger("iprt.viewer")
POLL_S, REST_POLL_S = 0.008, 0.05
"""Polling intervals in seconds for a picture: while one is expected, and otherwise."""
PANELS_S = 0.1
"""Interval in seconds between updates of the panels."""
TURNED_S = 1.0
"""Time after a turn in which the video around is kept up to date while it plays."""


@dataclass(frozen=True)
class Camera:
    """The camera sent by a browser through viser: quaternion, vertical field of view in radians."""

    wxyz: tuple[float, ...]
    fov: float
    width: int
    height: int


class Browser(BrowserState):
    """One browser's session, from its connection until it is gone.

    Parameters
    ----------
    engine : Engine
    client : viser.ClientHandle
    start : Start
    uploads : Path
        Folder for files that its user adds.

    Attributes
    ----------
    viewport : Viewport
        Used by this window's thread only.
    """

    def __init__(self, engine: Engine, client: Any, start: Start, uploads: Path) -> None:
        super().__init__(engine, client, uploads)
        self._start = start
        self._closed = False
        self._camera: Camera | None = None
        self._followed: Camera | None = None
        self._defects: set[str] = set()
        self._leader = Leader(client, start.view)
        self._name: str | None = None  # of the view that the camera was led to
        self._turned_s = -TURNED_S
        self._camera_came(client.camera)
        self._thread = threading.Thread(
            target=self._run, name=f"iprt browser {client.client_id}", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Tell the thread to end, after the browser has disconnected."""
        self._closed = True
        self._wake.set()

    def join(self, timeout_s: float) -> None:
        """Wait for the thread to end."""
        self._thread.join(timeout_s)

    # Any thread may call these ----------------------------------------------------------------

    def _divide(self, split: float) -> None:
        """Divide the picture at a fraction of the window's width."""

        def divide() -> None:
            at = min(max(self.in_picture(split, 0.5)[0], 0.0), 1.0)
            self.viewport.lens = replace(self.viewport.lens, split=at)

        self.post("divide", divide)

    def _camera_came(self, camera: Any) -> None:
        wxyz = tuple(float(value) for value in camera.wxyz)
        if not np.isfinite([*wxyz, camera.fov]).all():
            return
        came = Camera(wxyz, camera.fov, camera.image_width, camera.image_height)
        if came != self._camera:
            self._camera = came
            self._wake.set()

    # The window's thread calls these ----------------------------------------------------------

    def _report_defect(self, error: Exception) -> None:
        """Report an internal error; the window continues, and the error may recur."""
        text = f"a defect of iprt: {type(error).__name__}: {error}"
        if text not in self._defects:
            self._defects.add(text)
            LOG.error("a defect of iprt", exc_info=error)
            self.say(text, bad=True)

    def _lead(self) -> None:
        """Turn the browser's camera if its view was chosen, typed or turned by keyframes."""
        view, name = self.viewport.view, self.viewport.name
        if not same(view, self._leader.view):
            self._leader.lead(view, moving=name is not None and name == self._name)
        self._name = name

    def _clicked(self, x: float, y: float, *, more: bool) -> None:
        """Select the object at a window position, and read the pixel's values."""
        x, y = self.in_picture(x, y)
        self.pick(self.object_at(x, y), more=more)
        self.read, self.read_at = self.viewport.readout(x, y), (x, y)

    def _dropped(self, x: float, y: float) -> None:
        if self.selected is None:
            self.say("first click the object to place there", bad=True)
        elif not self.drop(*self.in_picture(x, y)):
            self.say("there is no surface: the video shows open sky there", bad=True)

    def _run(self) -> None:
        start, camera = self._start, self._camera
        assert camera is not None
        view = start.view.resized(max(camera.width, 1), max(camera.height, 1))
        self.viewport = Viewport(
            self.engine, view, objects=start.objects, target_fps=start.target_fps
        )
        self.viewport.lens = start.lens
        try:
            self._serve()
        finally:
            self.viewport.close()

    def _serve(self) -> None:
        if self._closed:
            return
        self._leader.lead(self.viewport.view)
        divider = Divider(self.client, self._divide)
        self._sender, self._around = PictureSender(self.client, divider), Around(self.client)
        panels = Panels(self)
        self.gizmos = ObjectGizmo(self), SunGizmo(self), MotionPath(self)
        self._listen()
        due_s = 0.0
        while not self._closed:
            self._wake.clear()
            try:
                self._work()
                busy = self._show()
                if time.monotonic() >= due_s:
                    panels.sync()
                    for gizmo in self.gizmos:
                        gizmo.sync()
                    due_s = time.monotonic() + PANELS_S
            except IprtError as error:
                self.say(str(error), bad=True)
                busy = False
            except Exception as error:
                self._report_defect(error)
                busy = False
            if not busy:
                waiting = self.engine.status.doing == "waiting"
                self._wake.wait(REST_POLL_S if waiting else POLL_S)

    def _listen(self) -> None:
        client = self.client

        async def moved(camera: Any) -> None:
            self._camera_came(camera)

        async def clicked(event: Any) -> None:
            x, y = event.screen_pos
            self.post("click", lambda: self._clicked(x, y, more=False))

        async def added(event: Any) -> None:
            x, y = event.screen_pos
            self.post("click", lambda: self._clicked(x, y, more=True))

        async def dropped(event: Any) -> None:
            x, y = event.screen_pos
            self.post("click", lambda: self._dropped(x, y))

        client.camera.on_update(moved)
        client.scene.on_click()(clicked)
        client.scene.on_click(modifier="cmd/ctrl")(added)
        client.scene.on_click(modifier="shift")(dropped)

    def _work(self) -> None:
        self.run_posted()
        self._lead()
        camera = self._camera
        if camera is None or camera == self._followed:
            return
        viewport = self.viewport
        viewport.resize(camera.width, camera.height)
        view = look_of(viewport.view, np.array(camera.wxyz), camera.fov)
        if self._leader.heard(view):
            if not same(view, viewport.view):
                viewport.look(view)
                self._turned_s = time.monotonic()
            self._leader.view = viewport.view
        if not self._leader.waits:
            self._followed = camera

    def _show(self) -> bool:
        """Send the newest picture; return True if there was one."""
        viewport, camera = self.viewport, self._camera
        displayed = viewport.poll()
        self._lead()
        if displayed is None or camera is None or self._closed:
            return False
        size = max(camera.width, 1), max(camera.height, 1)
        sent = self._sender.follow(displayed, size, viewport.lens.split)
        self.displayed, self.lossless = displayed, self._sender.lossless
        turned = time.monotonic() < self._turned_s + TURNED_S
        if not sent and (turned or not self.engine.playback.playing):
            self._around.show(viewport.surroundings)
        return sent
