"""A viewer of this process: `view`."""

from __future__ import annotations

import html
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Self

from iprt.geometry.camera import View
from iprt.scene.edit_writing import SAVED_VIEW
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.viewer.engine import Engine
from iprt.viewer.opening import FPS, engine_of
from iprt.viewer.program.control import Control
from iprt.viewer.requirements import require_browser
from iprt.viewer.windows import Start

if TYPE_CHECKING:
    from iprt.viewer.web.host import Host

FRAME_PX = 600
"""Height of the frame in a notebook."""
FIRST_VIEW = View(1024, 1024)
"""View of a scene that has none."""


def view(
    scene: Scene | Path | str,
    view: str | None = None,
    *,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    settings: Settings | None = None,
    device: str | None = None,
    port: int = 0,
) -> Viewer:
    """Open a viewer of a scene for browsers of this machine, and return at once.

    As the last value of a notebook's cell it shows itself. It ends with `Viewer.close`, or with the
    process. Needs the extra `view`.

    Parameters
    ----------
    scene : Scene or path
    view : str, optional
        Name of the view to start from. Default: `saved`, the view at the last save if there is one,
        or else the scene's first view.
    yaw, pitch, fov : float, optional
        Viewing direction and vertical field of view in degrees, in place of a view.
    settings : Settings, optional
        By default the method's.
    device : str, optional
        As `--device` of `iprt view`.
    port : int
        0 for any free port.

    Returns
    -------
    Viewer

    Raises
    ------
    IprtError
        The scene, the view, the device or the port cannot be used, or viser is missing.
    """
    require_browser()
    from iprt.viewer.web.host import Host

    opened = scene if isinstance(scene, Scene) else Scene.open(Path(scene))
    engine = engine_of(opened, settings or Settings(), device)
    try:
        host = Host(engine, first_start(opened), port)
    except BaseException:
        engine.close()
        raise
    viewer = Viewer(engine, host)
    try:
        if view is not None or yaw is not None or pitch is not None or fov is not None:
            viewer.look(view, yaw=yaw, pitch=pitch, fov=fov)
    except BaseException:
        viewer.close()
        raise
    return viewer


def first_start(scene: Scene) -> Start:
    """Return the state in which a scene's windows begin: its saved view, or its first one."""
    names = [SAVED_VIEW, *scene.views]
    entry = next((scene.views[name] for name in names if name in scene.views), None)
    if entry is None:
        return Start(FIRST_VIEW, target_fps=FPS)
    return Start(entry.view, entry.objects, FPS)


class Viewer(Control):
    """A viewer for browsers, open until `close`; a context manager.

    Parameters
    ----------
    engine : Engine
    host : Host
        Both are closed with the viewer.

    Attributes
    ----------
    url : str
        Address for browsers of this machine.
    """

    def __init__(self, engine: Engine, host: Host) -> None:
        super().__init__(engine, host)
        self._host, self.url = host, host.url
        self._name, self._closed = engine.scene.name, False
        _open.add(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self._end()

    def close(self) -> None:
        """End the viewer, and discard unsaved edits."""
        self._engine.autosaver.abandon()
        self._end()

    def _end(self) -> None:
        """End the viewer; unsaved edits are kept for the next one."""
        self._closed = True
        _open.discard(self)
        try:
            self._host.close()
        finally:
            self._engine.close()

    def _leave(self) -> None:
        self.close()

    def __repr__(self) -> str:
        if self._closed:
            return f"<closed viewer of {self._name}>"
        return f"<viewer of {self._name} at {self.url}>"

    def _repr_html_(self) -> str:
        """Return the viewer as a frame of a notebook, with the address below it."""
        if self._closed:
            return html.escape(repr(self))
        url, ssh = self.url, html.escape(self._host.ssh)
        return (
            f'<iframe src="{url}" title="iprt" width="100%" height="{FRAME_PX}" '
            'style="border: 0"></iframe>'
            f'<p>The viewer is at <a href="{url}">{url}</a> on the machine that runs the notebook. '
            f"From another machine: <code>{ssh}</code>, then open that address there.</p>"
        )


_open: set[Viewer] = set()


def _close_all() -> None:
    for viewer in tuple(_open):
        viewer._end()


# `atexit` is too late: it follows the wait for executors' threads, and one of them decodes video
# until its viewer is closed.
threading._register_atexit(_close_all)  # type: ignore[attr-defined]
