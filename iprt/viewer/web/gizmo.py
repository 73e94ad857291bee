"""The gizmo of the selected object, drawn by the browser over the picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.gizmo import turn_and_middle, with_turn_and_middle
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.camera import quaternion, rotation

Float = NDArray[np.float64]

NAME = "/gizmo"
SIZE_PX = 90.0
MIN_MOVE = 1e-9
"""Least motion, in metres and in matrix elements."""


class Gizmo:
    """The gizmo that moves and rotates the selected object, for use by the window's thread."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui = ui
        self._handle: Any = None
        self._name: str | None = None
        self._shown: tuple[Float, Float] | None = None  # the rotation and position of its handle
        self._dragged = False

    def sync(self) -> None:
        """Move the gizmo to the selected object, except while the gizmo is dragged."""
        state = self._ui.state
        if state is None or state.name != self._name:
            self._remove()
        if state is None or self._dragged:
            return
        if self._handle is None:
            self._add(state.name)
        turn, middle = turn_and_middle(state)
        middle = middle - self._ui.centre
        if self._shown is None or not all(map(np.array_equal, self._shown, (turn, middle))):
            self._shown = turn, middle
            self._handle.wxyz, self._handle.position = quaternion(turn), middle

    def _remove(self) -> None:
        if self._handle is not None:
            self._handle.remove()
        self._handle = self._shown = self._name = None
        self._dragged = False

    def _add(self, name: str) -> None:
        self._name = name
        self._handle = self._ui.client.scene.add_transform_controls(
            NAME, SIZE_PX, fixed=True, line_width=3.0, depth_test=False
        )

        async def updated(event: Any) -> None:
            ended = event.phase == "end"
            self._dragged = not ended
            turn, position = rotation(np.array(event.target.wxyz)), np.array(event.target.position)
            self._ui.post("gizmo", lambda: self._moved(turn, position, ended=ended))

        self._handle.on_update(updated)

    def _moved(self, turn: Float, position: Float, *, ended: bool) -> None:
        """Move the object to the dragged gizmo."""
        ui, state = self._ui, self._ui.state
        if state is None or state.name != self._name:
            return
        if ended:
            self._shown = None  # so that `sync` moves the gizmo to the object
        before = turn_and_middle(state)
        middle = position + ui.centre
        if max(np.abs(turn - before[0]).max(), np.abs(middle - before[1]).max()) < MIN_MOVE:
            return
        if not (ui.snapping and ui.drop_at(position)):
            ui.place(state, with_turn_and_middle(state, turn, middle))
