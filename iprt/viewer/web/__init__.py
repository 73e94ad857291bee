"""The viewer in a browser, through viser: for a device in another room.

One engine renders for all browsers, each of which has a view and a lens of its own. Edits, the
video and the settings are shared.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from iprt.viewer.requirements import require_browser

if TYPE_CHECKING:
    from iprt.geometry.camera import View
    from iprt.viewer.engine import Engine

PORT = 8080
FOV_DEG = 70.0
"""Initial vertical field of view if the requested view is a whole panorama."""


def serve(
    engine: Engine,
    view: View,
    *,
    objects: tuple[str, ...] | None = None,
    port: int = PORT,
    target_fps: float | None = None,
    ready: Callable[[int], None],
) -> None:
    """Serve an engine's pictures to browsers of this machine, until interrupted (Ctrl+C).

    Parameters
    ----------
    engine : Engine
        It stays open afterwards.
    view : View
        Initial view of each browser; its size follows the window.
    objects : tuple of str or None
        Names of the initially shown objects; None for all.
    port : int
        0 for any free port.
    target_fps : float or None
        Initial frame rate to hold during motion (`Viewport`).
    ready : callable
        Called with the port once browsers can connect.

    Raises
    ------
    IprtError
        viser is missing, or the port is taken.
    """
    require_browser()
    from iprt.viewer.web.browser import Start
    from iprt.viewer.web.host import Host

    if view.projection == "equirect":
        view = replace(view, projection="perspective", fov_y_deg=FOV_DEG)
    with warnings.catch_warnings(), contextlib.suppress(KeyboardInterrupt):
        # Browsers may leave at any moment; messages on their way to them are dropped.
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
        begin = Start(view, objects, target_fps)
        with Host(engine, begin, port) as hosting:
            ready(hosting.port)
            hosting.wait()
