"""State shared by the window's parts, and the actions of keys and buttons."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from queue import SimpleQueue

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.geometry.mesh_files import MESH_SUFFIXES
from iprt.viewer.desktop.gizmo import Mode
from iprt.viewer.engine import Engine
from iprt.viewer.objects import ObjectState
from iprt.viewer.timeline import Timeline
from iprt.viewer.ui_state import UiState
from iprt.viewer.viewport import Viewport

NOTICE_S = 6.0
"""A notice is shown so long."""


class DesktopState(UiState):
    """The state of a window, and what is open in it.

    Parameters
    ----------
    engine : Engine
    viewport : Viewport
    folder : Path
        Where screenshots go.

    Attributes
    ----------
    mode : {"move", "turn", "scale"}
        What the gizmo does.
    readout : bool
        The values at the cursor are shown beside it.
    panels, help, browsing, leaving : bool
        What is open: the panels; the list of shortcuts; the browser of mesh files; the question
        whether to save.
    closing : bool
        The window is to close as soon as all is saved.
    cursor : (x, y) or None
        Place in the last picture that the mouse is at, as shares of its width and height.
    timeline : Timeline
        What the last view frames took.
    """

    def __init__(self, engine: Engine, viewport: Viewport, folder: Path) -> None:
        super().__init__(engine)
        self.viewport, self.folder = viewport, folder
        self.mode: Mode = "move"
        self.readout = self.panels = True
        self.help = self.browsing = self.leaving = self.closing = False
        self.cursor: tuple[float, float] | None = None
        self.timeline = Timeline()
        self._notice: tuple[str, bool, float] | None = None
        self._saved: SimpleQueue[str | None] = SimpleQueue()  # what came of it

    # Notices ----------------------------------------------------------------------------------

    def say(self, text: str, *, bad: bool = False) -> None:
        self._notice = text, bad, time.monotonic() + NOTICE_S

    @property
    def notice(self) -> tuple[str, bool] | None:
        """The present notice, and whether it is bad."""
        if self._notice is None or time.monotonic() > self._notice[2]:
            self._notice = None
            return None
        return self._notice[:2]

    # Objects ----------------------------------------------------------------------------------

    def place(self, state: ObjectState, to_world: NDArray[np.float64]) -> None:
        """Want an object there in the frame that is shown."""
        try:
            self.engine.place(state.name, state.placed(to_world))
        except IprtError as error:
            self.say(str(error), bad=True)

    def add(self, paths: Sequence[Path]) -> None:
        """Set meshes down on the surface at the cursor, or in the middle of the picture."""
        for path in paths:
            if path.suffix.lower() not in MESH_SUFFIXES:
                kinds = ", ".join(MESH_SUFFIXES)
                self.say(f"{path.name}: not a mesh; these are read: {kinds}", bad=True)
                continue
            x, y = self.cursor or (0.5, 0.6)
            self.selected = self.engine.add(path, *self.viewport.aim(x, y))
            self.say(f"{path.name} is read, to be {self.selected}")

    def browse(self) -> None:
        """Open the browser of mesh files, or close it."""
        self.browsing = not self.browsing

    @property
    def unsaved(self) -> bool:
        """There are edits that the scene's file does not have."""
        return bool(self.engine.unsaved)

    def save(self) -> None:
        """Write the scene's file."""
        if self.unsaved:
            self.viewport.save(self._saved.put)
        else:
            self.say("nothing to save")

    def report_saved(self) -> None:
        """Show the result of `save`; after a problem the window stays."""
        while not self._saved.empty():
            if self._saved.get() is None:
                self.say(f"saved to {self.engine.scene.root / 'scene.toml'}")
            else:
                self.closing = False

    def step(self, frames: int) -> None:
        """Pause, so many frames later."""
        if len(self.frames) > 1:
            frame = self.frame
            self.engine.pause()
            self.engine.seek(frame + frames)

    # Files ------------------------------------------------------------------------------------

    def screenshot(self, suffix: str) -> Path | None:
        """Write a picture to a file that is not there yet; its path."""
        try:
            path = self.viewport.screenshot(suffix, self.folder)
        except IprtError as error:
            self.say(str(error), bad=True)
            return None
        self.say(f"written: {path}")
        return path

    def escape(self) -> None:
        """Close what is open, or else let go of what is selected."""
        if self.help or self.browsing or self.leaving:
            self.help = self.browsing = self.leaving = False
        else:
            self.selected = None
