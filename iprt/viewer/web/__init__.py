"""The viewer in a browser, through viser: for a device in another room.

One engine renders for all browsers, each of which has a view and a lens of its own. Edits, the
video and the settings are shared.
"""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from iprt.viewer.requirements import require_browser

if TYPE_CHECKING:
    from iprt.viewer.engine import Engine
    from iprt.viewer.web.host import Host
    from iprt.viewer.windows import Start, While

PORT = 8080


def serve(engine: Engine, start: Start, during: While[Host], *, port: int = PORT) -> None:
    """Serve an engine's pictures to browsers of this machine, until interrupted (Ctrl+C).

    Parameters
    ----------
    engine : Engine
        It stays open afterwards.
    start : Start
        Initial state of each browser; the size of its view follows the window.
    during : callable
        Returns a context for the time in which browsers can connect.
    port : int
        0 for any free port.

    Raises
    ------
    IprtError
        viser is missing, or the port is taken.
    """
    require_browser()
    from iprt.viewer.web.host import Host

    with (
        contextlib.suppress(KeyboardInterrupt),
        Host(engine, start, port) as host,
        during(host),
    ):
        host.wait()
