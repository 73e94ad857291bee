"""`iprt view`: a scene in a window or a browser, to look around, place objects, tune knobs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from iprt.commands.knobs import BALANCED, Knobs
from iprt.ending import Ended, raise_if_ended
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.viewer.engine import Engine
    from iprt.viewer.web import Address

WINDOW = (1280, 800)
FPS = 10.0
FRAME_LIMIT_S = 60.0
"""After which a viewer gives a frame up: nobody looks at a window that stands for longer."""
MAX_FPS = 240.0
LOCAL, PORT, MAX_PORT = "127.0.0.1", 8080, 65535


def view(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: str | None = None,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    size: tuple[int, int] = WINDOW,
    fps: float = FPS,
    method: Literal["iprt", "ibl"] | None = None,
    knobs: Knobs = BALANCED,
    device: str | None = None,
    web: bool = False,
    host: str = LOCAL,
    port: int = PORT,
    token: str | None = None,
    allow_outside: bool = False,
) -> int:
    """Open a scene, to look around, place objects, tune knobs and see what they cost.

    Drag to look, turn the wheel to zoom, click an object to select it, drop a mesh file to add it;
    H shows all keys. Needs the extra `view`: pip install 'iprt[view]'.

    Parameters
    ----------
    scene
        Scene folder. What is edited is written to its scene.toml when you save.
    view
        Name of a view of the scene to begin with, or `equirect` for the whole panorama. Default:
        the scene's first view.
    yaw
        Degrees to the right, for a view of your own with all objects.
    pitch
        Degrees up.
    fov
        Vertical field of view in degrees, above 1 and below 179.
    size
        Width and height of the window. A browser has its own.
    fps
        Frames per second to hold while something moves, by less resolution and cheaper knobs where
        the device is too slow; the viewer tells which. At rest nothing is given up. 0: never.
    method
        How virtual objects are lit; `ibl` is the baseline: a distant environment without real
        geometry. Short for --set method=.
    knobs
        Quality preset and single knobs to begin with. Later ones win: preset, file, flags.
    device
        gpu, cpu, a place such as 0:0 (see `iprt doctor`), or part of a device's name. Default: the
        fastest kind there is.
    web
        Serve it to browsers in place of a window.
    host
        Address to serve at. Others than this machine's own can be reached by others, who have to
        know the token.
    port
        TCP port to serve at; 0: any that is free.
    token
        What browsers have to know, to be asked for on this machine, too. Default: a random one
        where --host is not this machine's own.
    allow_outside
        Read files of the scene that are links to what lies outside its folder.

    Returns
    -------
    int
        Exit status 0.
    """
    if not 0.0 <= fps <= MAX_FPS:
        raise IprtError(f"--fps {fps:g}: expected 0 to {MAX_FPS:g} frames per second")
    if not 0 <= port <= MAX_PORT:
        raise IprtError(f"--port {port}: expected 0 to {MAX_PORT}")
    if not web and (token is not None or host != LOCAL or port != PORT):
        raise IprtError("--host, --port and --token: are for --web")

    from iprt.commands.views import moving_view
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.device.profile import SAMPLED_S
    from iprt.scene.camera import View
    from iprt.scene.scene import Scene
    from iprt.viewer.engine import Engine

    settings = knobs.resolved(method=method)
    opened = Scene.open(scene, allow_outside=allow_outside)
    found, objects = moving_view(opened, view, yaw=yaw, pitch=pitch, fov=fov, size=size)
    look = found if isinstance(found, View) else found.view
    handle = choose_device(device)

    def make_device() -> ComputeDevice:
        compute = ComputeDevice(handle, FRAME_LIMIT_S)
        compute.profile.every_s = SAMPLED_S
        return compute

    with Engine(opened, make_device, settings, allow_outside=allow_outside) as engine:
        if not web:
            from iprt.viewer.desktop import run

            with _telling_losses(engine):
                run(engine, look, objects=objects, target_fps=fps or None)
            return 0
        from iprt.viewer.web import serve

        with _telling_losses(engine):
            serve(
                engine,
                look,
                objects=objects,
                host=host,
                port=port,
                token=token,
                target_fps=fps or None,
                ready=_tell_address,
            )
    return 0


@contextmanager
def _telling_losses(engine: Engine) -> Iterator[None]:
    """Tell of edits that nobody has saved when a signal ends the viewer."""
    try:
        yield
        raise_if_ended()  # `serve` ends as usual
    except (KeyboardInterrupt, Ended) as ended:
        names = ", ".join(edit.name for edit in engine.world.edits)
        if names:
            ended.add_note(f"edits that nobody saved are lost, of: {names}")
        raise


def _tell_address(address: Address) -> None:
    """Where browsers go, and how those of other machines get there."""
    from socket import gethostname

    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True)
    console.print(f"open {address.url} in a browser; Ctrl+C ends")
    if address.local:
        port = address.port
        console.print(f"from another machine: ssh -L {port}:localhost:{port} {gethostname()}")
