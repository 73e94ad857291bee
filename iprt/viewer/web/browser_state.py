"""State shared by one browser's panels and gizmo."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.scene.manifest_writing import free_name
from iprt.viewer.engine import Engine
from iprt.viewer.picking import Readout
from iprt.viewer.ui_state import UiState

LONGEST = 60
"""Limit for the characters of a file name, which may have 255 bytes with the scene's additions."""


class BrowserState(UiState):
    """The state of one browser's window; only `post` is thread-safe.

    Parameters
    ----------
    engine : Engine
    client : viser.ClientHandle
    uploads : Path
        Folder for uploaded files.

    Attributes
    ----------
    snapping : bool
        Keep the selected object on surfaces during a drag.
    read : Readout or None
        Values of the last clicked pixel.
    read_at : (x, y)
        Position of that pixel in the picture.
    lossless : bool
        True if the browser has the lossless picture.
    """

    def __init__(self, engine: Engine, client: Any, uploads: Path) -> None:
        super().__init__(engine)
        self.client, self.uploads = client, uploads
        self.snapping = self.lossless = False
        self.read: Readout | None = None
        self.read_at = (0.0, 0.0)
        self._wake = threading.Event()

    def post(self, key: object, do: Callable[[], object]) -> None:
        """Schedule a call on the window's thread; only the newest of each key runs."""
        super().post(key, do)
        self._wake.set()

    def saved(self, problem: str | None) -> None:
        """Report the result of `save`."""
        super().saved(problem)
        if problem is not None:
            self.say(problem, bad=True)

    def say(self, text: str, *, bad: bool = False) -> None:
        """Show a notification; see `UiState.say`."""
        how: dict[str, Any] = {"color": "red"} if bad else {}
        self.client.add_notification("", text, auto_close_seconds=8.0 if bad else 4.0, **how)

    def received(self, name: str, content: bytes) -> Path:
        """Write an uploaded file to a folder of its own; saving the scene reads it again."""
        stem, suffix = free_name(Path(name).stem[:LONGEST], set()), Path(name).suffix.lower()
        path = Path(tempfile.mkdtemp(dir=self.uploads)) / f"{stem}{suffix}"
        path.write_bytes(content)
        return path

    def in_picture(self, x: float, y: float) -> tuple[float, float]:
        """Convert a window position to a position in the picture, which may be wider or narrower.

        Both have the same height: see `TruthReader.view`.
        """
        if self.displayed is None:
            return x, y
        window, picture = self.viewport.view, self.displayed.shown.request.view
        wider = (picture.width * window.height) / (picture.height * window.width)
        return 0.5 + (x - 0.5) / wider, y

    def drop_at(self, point: NDArray[np.float64]) -> bool:
        """Place the selected object on the surface behind a point in the browser's scene."""
        view = self.viewport.view
        x, y = view.project(point) / (view.width, view.height)
        return bool(np.isfinite(x + y)) and self.drop(*self.in_picture(x, y))
