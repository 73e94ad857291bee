"""The viewer in a desktop window: `run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from iprt.viewer.requirements import require_window

if TYPE_CHECKING:
    from iprt.geometry.camera import View
    from iprt.viewer.engine import Engine


def run(
    engine: Engine,
    view: View,
    *,
    objects: tuple[str, ...] | None = None,
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
    target_fps : float or None
        Initial frame rate to hold during motion (`Viewport`).

    Raises
    ------
    IprtError
        The window's packages are not installed, or there is no display.
    """
    require_window()
    from iprt.viewer.desktop.app import App
    from iprt.viewer.viewport import Viewport

    app = App(engine, Viewport(engine, view, objects=objects, target_fps=target_fps))
    try:
        app.run()
    finally:
        app.close()
