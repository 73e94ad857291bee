"""State shared by the panels and the gizmo of one browser."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.displayed import Readout
from iprt.viewer.engine import Engine
from iprt.viewer.ui_state import UiState


class BrowserState(UiState):
    """The state of one browser's window. All but `post` is for the window's thread.

    Parameters
    ----------
    engine : Engine
    client : viser.ClientHandle
    uploads : Path
        Folder for files that its user adds.

    Attributes
    ----------
    snapping : bool
        The selected object stays on surfaces while it is dragged.
    read : Readout or None
        What the pixel holds that was clicked last.
    lossless : bool
        The browser has the picture without loss.
    """

    def __init__(self, engine: Engine, client: Any, uploads: Path) -> None:
        super().__init__(engine)
        self.client, self.uploads = client, uploads
        self.snapping = self.lossless = False
        self.read: Readout | None = None
        self._wake = threading.Event()
        self._todo: dict[object, Callable[[], object]] = {}

    def post(self, key: object, do: Callable[[], object]) -> None:
        """Have something done by the window's thread; of what has the same key, the newest."""
        self._todo[key] = do
        self._wake.set()

    def say(self, text: str, *, bad: bool = False) -> None:
        """See `UiState.say`."""
        how: dict[str, Any] = {"color": "red"} if bad else {}
        self.client.add_notification("", text, auto_close_seconds=8.0 if bad else 4.0, **how)

    @property
    def centre(self) -> NDArray[np.float64]:
        """The capture centre in the world, which is the origin of what the browser draws."""
        pose = None if self.displayed is None else self.displayed.shown.pose
        return np.zeros(3) if pose is None else pose[:3, 3]

    def in_picture(self, x: float, y: float) -> tuple[float, float]:
        """A place in the window as shares of the picture, which may be wider or narrower.

        Both are as high: see `Truth.view`.
        """
        if self.displayed is None:
            return x, y
        window, picture = self.viewport.view, self.displayed.shown.request.view
        wider = (picture.width * window.height) / (picture.height * window.width)
        return 0.5 + (x - 0.5) / wider, y

    def drop_at(self, point: NDArray[np.float64]) -> bool:
        """Set the selected object on the surface behind a point that the browser draws."""
        view = self.viewport.view
        x, y = view.project(point) / (view.width, view.height)
        if self.selected is None or not np.isfinite(x + y):
            return False
        return self.viewport.drop(self.selected, *self.in_picture(x, y), upright=not self.align)
