"""The viewer in a window of the desktop: `run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from iprt.viewer.needs import require_window
from iprt.viewer.state import REST_FRAMES

if TYPE_CHECKING:
    from pathlib import Path

    from iprt.geometry.camera import View
    from iprt.viewer.engine import Engine


def run(
    engine: Engine,
    view: View,
    *,
    objects: tuple[str, ...] | None = None,
    folder: Path | None = None,
    frames: int = REST_FRAMES,
    target_fps: float | None = None,
) -> None:
    """Show a scene in a window, until the user closes it.

    Parameters
    ----------
    engine : Engine
        Stays open.
    view : View
        Where to look at first; its size is that of the window.
    objects : tuple of str or None
        Names of the objects to show at first. None: all.
    folder : Path or None
        Where screenshots go, and where one looks for meshes first. None: the user's pictures, and
        the current folder.
    frames : int
        View frames to which a picture at rest is refined.
    target_fps : float or None
        Frames per second to hold while something moves (`Viewport.target_fps`), to begin with.

    Raises
    ------
    IprtError
        What the window needs is not installed; or there is no display.
    """
    require_window()
    from iprt.viewer.desktop.app import App

    app = App(engine, view, objects=objects, folder=folder, frames=frames)
    app.ui.viewport.target_fps = target_fps
    try:
        app.run()
    finally:
        app.close()
