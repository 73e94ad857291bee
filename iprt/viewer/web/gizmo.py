"""The gizmo of the selected object, drawn by the browser over the picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from iprt.viewer.objects import ObjectState
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.camera import quaternion, rotation

Float = NDArray[np.float64]

NAME = "/gizmo"
SIZE_PX = 90.0
MIN_MOVE = 1e-9
"""Least motion, in metres and in matrix elements."""


class Gizmo:
    """The gizmo that moves and rotates the selected object, for use by the window's thread."""

    def __init__(self, browser: BrowserState) -> None:
        self._browser = browser
        self._handle: Any = None
        self._name: str | None = None
        self._shown: Float | None = None  # the to_world that it shows
        self._dragged = False

    def sync(self) -> None:
        """Move the gizmo to the selected object, except while the gizmo is dragged."""
        state = self._browser.state
        if state is None or state.name != self._name:
            self._remove()
        if state is None or self._dragged:
            return
        if self._handle is None:
            self._add(state)
        placed = _relative(state, self._browser.centre)
        if self._shown is None or not np.array_equal(placed, self._shown):
            self._shown = placed
            turn, _ = polar(placed[:3, :3])
            self._handle.wxyz = quaternion(turn)
            self._handle.position = _middle(state, placed)

    def _remove(self) -> None:
        if self._handle is not None:
            self._handle.remove()
        self._handle = self._shown = self._name = None
        self._dragged = False

    def _add(self, state: ObjectState) -> None:
        self._name = state.name
        self._handle = self._browser.client.scene.add_transform_controls(
            NAME, SIZE_PX, fixed=True, line_width=3.0, depth_test=False
        )

        async def updated(event: Any) -> None:
            ended = event.phase == "end"
            self._dragged = not ended
            handle = event.target
            pose = np.array(handle.wxyz), np.array(handle.position)
            self._browser.post("gizmo", lambda: self._moved(pose, ended=ended))

        self._handle.on_update(updated)

    def _moved(self, pose: tuple[Float, Float], *, ended: bool) -> None:
        """Move the object to the dragged gizmo."""
        browser, state = self._browser, self._browser.state
        if state is None or state.name != self._name:
            return
        if ended:
            self._shown = None  # so that `sync` moves the gizmo to the object
        before = _relative(state, browser.centre)
        turn, stretch = polar(before[:3, :3])
        to_world = np.eye(4)
        to_world[:3, :3] = rotation(pose[0]) @ stretch
        to_world[:3, 3] = pose[1] - to_world[:3, :3] @ np.mean(state.corners, axis=0)
        apart = np.abs(to_world[:3, 3] - before[:3, 3]).max()
        if max(apart, np.abs(rotation(pose[0]) - turn).max()) < MIN_MOVE:
            return
        if browser.snapping and browser.drop_at(pose[1]):
            return
        to_world[:3, 3] += browser.centre
        browser.engine.place(state.name, state.placed(to_world))


def polar(linear: Float) -> tuple[Float, Float]:
    """Return a rotation and a stretch, (3, 3) both, whose product is an invertible `linear`."""
    turn, stretch = linalg.polar(linear)
    sign = np.sign(np.linalg.det(turn))
    return sign * turn, sign * stretch


def _relative(state: ObjectState, centre: Float) -> Float:
    placed = state.to_world.copy()
    placed[:3, 3] -= centre
    return placed


def _middle(state: ObjectState, placed: Float) -> Float:
    """Return the centre of the object's box."""
    middle: Float = placed[:3, :3] @ np.mean(state.corners, axis=0) + placed[:3, 3]
    return middle
