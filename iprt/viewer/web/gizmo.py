"""The gizmos of the selection, drawn by the browser over the picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.viewer.gizmo import turn_of, turned_to
from iprt.viewer.object_states import ObjectState
from iprt.viewer.sun_arrow import COLOR, HEAD, WIDTH
from iprt.viewer.web.browser_state import BrowserState
from iprt.viewer.web.camera import quaternion, rotation

Float = NDArray[np.float64]

NAME, SUN_NAME = "/gizmo", "/sun"
SIZE_PX = 90.0
MIN_MOVE = 1e-9
"""Least motion, in metres and in matrix elements."""


class Gizmo(ABC):
    """A gizmo that moves or turns something, for use by the window's thread."""

    def __init__(self, ui: BrowserState) -> None:
        self._ui = ui
        self._handle: Any = None
        self._name: str | None = None
        self._shown: tuple[Float, Float] | None = None  # the rotation and position of its handle
        self._dragged = False

    @property
    @abstractmethod
    def _place(self) -> tuple[str, Float, Float] | None:
        """Name, rotation (3, 3) and place in the world (3,) of the selection."""

    @abstractmethod
    def _add(self) -> Any:
        """Add viser's handle."""

    @abstractmethod
    def _move(self, turn: Float, position: Float) -> None:
        """Move the selection; the position is from the capture centre."""

    def sync(self) -> None:
        """Move the gizmo to the selection, except while the gizmo is dragged."""
        place = self._place
        if place is None or place[0] != self._name:
            self._remove()
        if place is None or self._dragged:
            return
        name, turn, pivot = place
        if self._handle is None:
            self._name, self._handle = name, self._add()
            self._listen()
        pivot = pivot - self._ui.centre
        if self._shown is None or not all(map(np.array_equal, self._shown, (turn, pivot))):
            self._shown = turn, pivot
            self._handle.wxyz, self._handle.position = quaternion(turn), pivot

    def _remove(self) -> None:
        if self._handle is not None:
            self._handle.remove()
        self._handle = self._shown = self._name = None
        self._dragged = False

    def _listen(self) -> None:
        async def updated(event: Any) -> None:
            ended = event.phase == "end"
            self._dragged = not ended
            turn, position = rotation(np.array(event.target.wxyz)), np.array(event.target.position)
            self._ui.post(self, lambda: self._moved(turn, position, ended=ended))

        self._handle.on_update(updated)

    def _moved(self, turn: Float, position: Float, *, ended: bool) -> None:
        """Move the selection to the dragged gizmo."""
        place = self._place
        if place is None or place[0] != self._name:
            return
        _, before, pivot = place
        moved = np.abs(position + self._ui.centre - pivot).max()
        if max(np.abs(turn - before).max(), moved) >= MIN_MOVE:
            self._move(turn, position)
        if ended:
            self._shown = None  # so that `sync` moves the gizmo to the selection


class ObjectGizmo(Gizmo):
    """The gizmo that moves and rotates the selected object."""

    @property
    def _place(self) -> tuple[str, Float, Float] | None:
        state = self._ui.state
        if state is None or state.locked:
            return None
        return state.name, turn_of(state), state.pivot

    def _add(self) -> Any:
        return self._ui.client.scene.add_transform_controls(
            NAME, SIZE_PX, fixed=True, line_width=3.0, depth_test=False
        )

    def _move(self, turn: Float, position: Float) -> None:
        ui, state = self._ui, self._ui.state
        assert isinstance(state, ObjectState)
        if ui.stepped:
            turn, position = self._stepped(turn, position)
        if not (ui.snapping and ui.drop_at(position)):
            ui.selection.place(state, turned_to(state, turn, position + ui.centre))

    def _stepped(self, turn: Float, position: Float) -> tuple[Float, Float]:
        """Return the rotation and place that are whole steps from where the drag began."""
        ui = self._ui
        assert self._shown is not None
        before, start = self._shown
        moved = ui.step_m * np.rint((position - start) / ui.step_m)
        turned = Rotation.from_matrix(turn @ before.T).as_rotvec(degrees=True)
        turned = ui.step_deg * np.rint(turned / ui.step_deg)
        return Rotation.from_rotvec(turned, degrees=True).as_matrix() @ before, start + moved


class SunGizmo(Gizmo):
    """The arrow of the selected sun, with rings that turn it."""

    _length: float | None = None  # of the arrow that is drawn

    @property
    def _place(self) -> tuple[str, Float, Float] | None:
        arrow = self._ui.arrow(self._ui.viewport.view)
        return None if arrow is None else (SUN_NAME, arrow.turn, arrow.point)

    def _add(self) -> Any:
        self._length = None
        return self._ui.client.scene.add_transform_controls(
            SUN_NAME,
            SIZE_PX,
            fixed=True,
            line_width=3.0,
            depth_test=False,
            disable_axes=True,
            disable_sliders=True,
        )

    def _move(self, turn: Float, position: Float) -> None:
        self._ui.shine(direction=turn[:, 1].tolist())

    def sync(self) -> None:
        """Move the arrow; its part of the handle follows a drag at once."""
        super().sync()
        arrow = self._ui.arrow(self._ui.viewport.view)
        if self._handle is None or arrow is None or arrow.length == self._length:
            return
        self._length = length = arrow.length
        self._ui.client.scene.add_arrows(
            f"{SUN_NAME}/arrow",
            np.array([[[0.0, length, 0.0], [0.0, 0.0, 0.0]]], np.float32),
            COLOR,
            shaft_radius=0.2 * WIDTH * length,
            head_radius=WIDTH * length,
            head_length=HEAD * length,
        )
