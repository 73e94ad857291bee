"""The viewer in a window of the desktop: `run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from iprt.errors import IprtError
from iprt.viewer.state import REST_FRAMES

if TYPE_CHECKING:
    from iprt.scene.camera import View
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
        Where screenshots go; the current one by default.
    frames : int
        View frames to which a picture at rest is refined.
    target_fps : float or None
        Frames per second to hold while something moves (`Viewport.target_fps`), to begin with.

    Raises
    ------
    IprtError
        What the window needs is not installed; or there is no display.
    """
    try:
        from iprt.viewer.desktop.app import App
    except ImportError as error:
        raise IprtError(
            f"the viewer needs what is not installed ({error.name}); pip install 'iprt[view]'"
        ) from error
    app = App(engine, view, objects=objects, folder=folder or Path.cwd(), frames=frames)
    app.desk.viewport.target_fps = target_fps
    try:
        app.run()
    finally:
        app.close()
