"""The viewer in a desktop window: `run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from iprt.viewer.requirements import require_window
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
    """Show a scene in a window until the user closes it.

    Parameters
    ----------
    engine : Engine
        It stays open afterwards.
    view : View
        Initial view; its size is the window's.
    objects : tuple of str or None
        Names of the initially shown objects; None for all.
    folder : Path or None
        Folder of screenshots, and initial folder of the mesh browser. None means the user's
        pictures and the current folder.
    frames : int
        View frames to which a picture at rest is refined.
    target_fps : float or None
        Initial frame rate to hold during motion (`Viewport.target_fps`).

    Raises
    ------
    IprtError
        The window's packages are not installed, or there is no display.
    """
    require_window()
    from iprt.viewer.desktop.app import App

    app = App(engine, view, objects=objects, folder=folder, frames=frames)
    app.ui.viewport.target_fps = target_fps
    try:
        app.run()
    finally:
        app.close()
