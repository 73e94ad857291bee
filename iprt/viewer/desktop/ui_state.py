"""State shared by the window's parts."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from iprt.errors import IprtError
from iprt.viewer.desktop.gizmo import Mode
from iprt.viewer.engine import Engine
from iprt.viewer.pass_times import PassTimes
from iprt.viewer.render_fields import TAB
from iprt.viewer.render_form import RenderForm
from iprt.viewer.screenshots import default_folder
from iprt.viewer.setting_fields import setting_groups
from iprt.viewer.ui_state import MIDDLE, UiState
from iprt.viewer.viewport import Viewport

NOTICE_S = 6.0
"""Seconds for which a notice is shown."""


class DesktopState(UiState):
    """The state of a window and its panels.

    Parameters
    ----------
    engine : Engine
    viewport : Viewport

    Attributes
    ----------
    folder : Path
        Folder of screenshots.
    mode : {"move", "turn", "scale"}
        Mode of the gizmo.
    readout : bool
        Show the values at the cursor.
    renaming : bool
        Put the keyboard into the name of the selected object.
    panels, help, browsing, leaving : bool
        Open parts: the panels; the list of shortcuts; the mesh browser; the question about unsaved
        edits.
    closing : bool
        Close the window after saving.
    cursor : (x, y) or None
        Mouse position in the last picture, as fractions of width and height.
    search : str
        Words that the shown settings have.
    pass_times : PassTimes
        Times of the last view frames.
    setting_groups : tuple
        Fields of all settings.
    render_form : RenderForm
    tab : str or None
        Name of the tab to open.
    """

    def __init__(self, engine: Engine, viewport: Viewport) -> None:
        super().__init__(engine)
        self.viewport, self.folder = viewport, default_folder()
        self.mode: Mode = "move"
        self.readout = self.panels = True
        self.search = ""
        self.help = self.browsing = self.leaving = self.closing = self.renaming = False
        self.cursor: tuple[float, float] | None = None
        self.pass_times, self.setting_groups = PassTimes(), setting_groups(self)
        self.render_form = RenderForm(self)
        self.tab: str | None = None
        self._notice: tuple[str, bool, float] | None = None

    # Notices ----------------------------------------------------------------------------------

    def say(self, text: str, *, bad: bool = False) -> None:
        """Show a notice for `NOTICE_S` seconds; `bad` marks a problem."""
        self._notice = text, bad, time.monotonic() + NOTICE_S

    @property
    def notice(self) -> tuple[str, bool] | None:
        """The current notice, with True if it reports a problem."""
        if self._notice is None or time.monotonic() > self._notice[2]:
            self._notice = None
            return None
        return self._notice[:2]

    # Objects ----------------------------------------------------------------------------------

    def add_all(self, paths: Sequence[Path]) -> None:
        """Add meshes on the surface at the cursor, or in the middle of the picture."""
        for path in paths:
            try:
                self.add(path, *(self.cursor or MIDDLE))
            except IprtError as error:
                self.say(str(error), bad=True)

    def add(self, path: Path, x: float, y: float) -> None:
        """Add a mesh as `UiState.add` does, and name it."""
        super().add(path, x, y)
        self.say(f"reading {path.name}, which becomes {self.selected}")

    def browse(self) -> None:
        """Open or close the mesh browser."""
        self.browsing = not self.browsing

    def saved(self, problem: str | None) -> None:
        """Report the result of `save`; after a problem the window stays open."""
        super().saved(problem)
        self.closing = self.closing and problem is None

    def step(self, frames: int) -> None:
        """Pause, and move by a number of frames."""
        if len(self.frames) > 1:
            frame = self.frame
            self.engine.pause()
            self.engine.seek(frame + frames)

    # Files ------------------------------------------------------------------------------------

    def open_renders(self) -> None:
        """Open the tab of renders to files."""
        self.panels, self.tab = True, TAB.name

    def screenshot(self, suffix: str) -> Path | None:
        """Write a picture to a new file, and return its path."""
        try:
            path = self.viewport.screenshot(suffix, self.folder)
        except IprtError as error:
            self.say(str(error), bad=True)
            return None
        self.say(f"written: {path}")
        return path

    def escape(self) -> None:
        """Close an open part, or else deselect."""
        if self.help or self.browsing or self.leaving:
            self.help = self.browsing = self.leaving = False
        else:
            self.selected = None
