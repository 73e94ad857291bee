"""The viewer in a desktop window: `run`."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

from iprt.files.termination import at_termination
from iprt.viewer.requirements import require_window

if TYPE_CHECKING:
    from iprt.viewer.desktop.app import App
    from iprt.viewer.engine import Engine
    from iprt.viewer.windows import Start, While


def run(engine: Engine, start: Start, during: While[App]) -> None:
    """Show a scene in a window until the user closes it.

    Parameters
    ----------
    engine : Engine
        It stays open afterwards.
    start : Start
        Initial state; the size of its view is the window's.
    during : callable
        Returns a context for the time in which the window is open.

    Raises
    ------
    IprtError
        The window's packages are not installed, or there is no display.
    """
    require_window()
    from iprt.viewer.desktop.app import App
    from iprt.viewer.viewport import Viewport

    viewport = Viewport(engine, start.view, objects=start.objects, target_fps=start.target_fps)
    with (
        closing(App(engine, viewport)) as app,
        during(app),
        at_termination(engine.autosaver.keep),
    ):
        app.run()
