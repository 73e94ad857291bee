"""`iprt view`: interactive viewer of a scene, in a window or a browser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.commands.flag_types import Size
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.viewer.engine import Engine
    from iprt.viewer.web.host import Host
    from iprt.viewer.windows import Windows

WINDOW = (1280, 800)
FPS = 10.0
MAX_FPS = 240.0
PORT, MAX_PORT = 8080, 65535


def view(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: str | None = None,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    size: Size = None,
    fps: float = FPS,
    method: str | None = None,
    setting_flags: ChosenSettings = BALANCED,
    device: str | None = None,
    web: bool = False,
    port: int = PORT,
    allow_outside: bool = False,
) -> int:
    """Open a scene in an interactive viewer.

    Look around, place objects, change settings and see their cost. Drag to look, turn the
    wheel to zoom, click an object to select it, drop a mesh file to add it; H shows all keys.
    Needs the extra `view`: pip install 'iprt[view]'.

    Parameters
    ----------
    scene
        Scene folder. Edits are written to its scene.toml when you save. Unsaved edits of a viewer
        that was killed are offered at the next start.
    view
        Name of the view to start from, or `equirect` for the whole panorama. Default: `saved`, the
        view at the last save if there is one, or else the scene's first view.
    yaw
        Viewing direction in degrees to the right, for a picture of all objects. Not with --view.
    pitch
        Viewing direction in degrees up. Not with --view.
    fov
        Vertical field of view in degrees, above 1 and below 179. Not with --view. Default: 60.
    size
        Width and height of the window in pixels; browsers have their own. Default: 1280 800.
    fps
        Frames per second to aim for while something moves. Where the device is too slow, the viewer
        lowers the resolution and settings, and shows which; at rest nothing is lowered. 0: never.
    method
        Relighting method: a name from `iprt methods`. Short for --set method=.
    device
        OpenCL device: gpu, cpu, PLATFORM:DEVICE such as 0:0 (`iprt doctor` lists them), or part of
        a name. Default: $IPRT_DEVICE, or else the fastest.
    web
        Serve the viewer to browsers of this machine instead of opening a window. Browsers of other
        machines connect through ssh, by the printed command.
    port
        TCP port to serve at; 0: any that is free.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    if not 0.0 <= fps <= MAX_FPS:
        raise IprtError(f"--fps {fps:g}: expected 0 to {MAX_FPS:g} frames per second")
    if not 0 <= port <= MAX_PORT:
        raise IprtError(f"--port {port}: expected 0 to {MAX_PORT}")
    if not web and port != PORT:
        raise IprtError("--port: is for --web")
    if web and size is not None:
        raise IprtError("--size: is for a window; with --web, browsers have sizes of their own")

    from iprt.commands.views import moving_view, require_size
    from iprt.geometry.camera import View
    from iprt.scene.edit_writing import SAVED_VIEW
    from iprt.scene.scene import Scene
    from iprt.viewer.opening import engine_of
    from iprt.viewer.windows import Start

    require_size(size)
    opened = Scene.open(scene, allow_outside=allow_outside)
    settings = setting_flags.resolved(opened, method=method)
    if SAVED_VIEW in opened.views and all(flag is None for flag in (view, yaw, pitch, fov)):
        view = SAVED_VIEW
    found, objects = moving_view(opened, view, yaw=yaw, pitch=pitch, fov=fov)
    look = (found if isinstance(found, View) else found.view).resized(*(size or WINDOW))
    start = Start(look, objects, fps or None)
    with engine_of(opened, settings, device) as engine:
        if web:
            from iprt.viewer.web import serve

            serve(engine, start, lambda host: _hosted(engine, host), port=port)
        else:
            from iprt.viewer.desktop import run

            run(engine, start, lambda windows: _controlled(engine, windows))
    return 0


def _controlled(engine: Engine, windows: Windows) -> AbstractContextManager[None]:
    """Let `iprt remote` control a viewer during the block."""
    from iprt.viewer.program.control import Control
    from iprt.viewer.program.listener import listening

    return listening(Control(engine, windows), windows.port, str(engine.scene.root.absolute()))


@contextmanager
def _hosted(engine: Engine, host: Host) -> Iterator[None]:
    """Print the address for browsers on this machine, and the ssh command for other machines."""
    with _controlled(engine, host):
        print(f"open {host.url} in a browser; Ctrl+C ends", flush=True)
        print(f"from another machine: {host.ssh}", flush=True)
        yield
