"""A browser's camera, turned by the viewer, and the turns of its user."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np

from iprt.geometry.camera import View
from iprt.viewer.web.camera import position_of

SETTLE_S, AGAIN_S = 60.0, 0.5
"""Longest time until a browser looks where it is sent, and the time after which that is sent again:
what arrives while the page is still being made is lost."""
SAME_DEG = 1e-4
WAYS = 256
"""Views of a motion that a browser may still answer to."""


class Leader:
    """A leader of one browser's camera, for use by one thread.

    Parameters
    ----------
    client : viser.ClientHandle
    view : View
        View that the camera has.

    Attributes
    ----------
    view : View
        View that the camera has, or is sent.
    waits : bool
        True until the browser looks where it is sent.
    """

    def __init__(self, client: Any, view: View) -> None:
        self._client = client
        self.view, self.waits = view, False
        self._follows = False
        self._ways: deque[View] = deque(maxlen=WAYS)
        self._sent_s = self._again_s = 0.0

    def lead(self, view: View, *, moving: bool = False) -> None:
        """Turn the camera to a view.

        Parameters
        ----------
        view : View
        moving : bool
            The view continues a motion. Once the browser follows it, its user can leave it.
        """
        if not moving:
            self._follows = False
            self._ways.clear()
        self._ways.append(self.view)
        self.view, self.waits = view, True
        self._sent_s = time.monotonic()
        self._send()

    def heard(self, view: View) -> bool:
        """Return True if the user has turned the camera to this view."""
        if not self.waits:
            return True
        now = time.monotonic()
        if same(view, self.view):
            self._follows, self.waits = True, False
        elif self._follows and self._passed(view):
            pass  # an answer to earlier messages
        elif self._follows or now > self._sent_s + SETTLE_S:
            self.waits = False
            return True
        elif now > self._again_s:
            self._send()
        return False

    def _passed(self, view: View) -> bool:
        """Return True if the camera was led there; its field of view may be ahead of its turn."""
        ways = [*self._ways, self.view]
        return any(_turned(view, way) < SAME_DEG for way in ways) and any(
            abs(view.fov_y_deg - way.fov_y_deg) < SAME_DEG for way in ways
        )

    def _send(self) -> None:
        self._again_s = time.monotonic() + AGAIN_S
        camera = self._client.camera
        with self._client.atomic():
            camera.fov = float(np.deg2rad(self.view.fov_y_deg))
            camera.position = position_of(self.view)
            camera.look_at = np.zeros(3)


def same(a: View, b: View) -> bool:
    """Return True if two cameras look alike, up to rounding."""
    return max(_turned(a, b), abs(a.fov_y_deg - b.fov_y_deg)) < SAME_DEG


def _turned(a: View, b: View) -> float:
    """Return by how many degrees yaw or pitch differ."""
    apart = abs((a.yaw_deg - b.yaw_deg + 180.0) % 360.0 - 180.0)
    return max(apart, abs(a.pitch_deg - b.pitch_deg))
