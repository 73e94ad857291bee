"""`iprt remote`: control of a running viewer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.commands.flag_types import Position, Rotation, Size

if TYPE_CHECKING:
    from iprt.viewer.program.client import RemoteViewer

FRAMES, TIMEOUT_S = 64, 600.0
Assignments = tyro.conf.Positional[tuple[str, ...]]


def status(*, port: int | None = None) -> int:
    """Print the state of a running viewer, as JSON.

    Parameters
    ----------
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    import json

    print(json.dumps(_viewer(port).status(), indent=2, ensure_ascii=False))
    return 0


def look(
    view: tyro.conf.Positional[str] = "",
    /,
    *,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    port: int | None = None,
) -> int:
    """Turn all windows of a running viewer to a view of the scene, or in a direction.

    Parameters
    ----------
    view
        Name of a view of the scene.
    yaw
        Viewing direction in degrees to the right. Default: as it is.
    pitch
        Viewing direction in degrees up. Default: as it is.
    fov
        Vertical field of view in degrees. Default: as it is.
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    _viewer(port).look(view or None, yaw=yaw, pitch=pitch, fov=fov)
    return 0


def load(
    mesh: tyro.conf.Positional[Path],
    /,
    *,
    yaw: float | None = None,
    pitch: float | None = None,
    up: str = "y",
    rotate: float = 0.0,
    height: float | None = None,
    material: str | None = None,
    port: int | None = None,
) -> int:
    """Add a mesh to the scene of a running viewer, and print its name.

    Parameters
    ----------
    mesh
        Mesh file.
    yaw
        Direction of its place in degrees to the right. Default: the middle of the picture.
    pitch
        Direction of its place in degrees up. Default: the middle of the picture.
    up
        The file's axis that points up: x, -x, y, -y, z or -z.
    rotate
        Rotation about the vertical in degrees, counter-clockwise from above.
    height
        Height in metres. Default: the longest side is a fifth of the distance.
    material
        As of `iprt scene add`. Default: the file's own.
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    viewer = _viewer(port)
    name = viewer.add(
        mesh, yaw=yaw, pitch=pitch, up=up, rotate=rotate, height=height, material=material
    )
    print(name)
    return 0


def set_(assignments: Assignments, /, *, port: int | None = None) -> int:
    """Change settings of a running viewer.

    Parameters
    ----------
    assignments
        Settings with their values, such as trace.rays=4.
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    _viewer(port).set(*assignments)
    return 0


def place(
    name: tyro.conf.Positional[str],
    /,
    *,
    position: Position = None,
    rotation: Rotation = None,
    size: float | None = None,
    port: int | None = None,
) -> int:
    """Move, turn or scale an object in a running viewer.

    Parameters
    ----------
    name
        Name of the object.
    position
        Centre of the bottom of its box in the world, in metres. Default: as it is.
    rotation
        Rotations about X, Y and Z in degrees; Z is applied first, Y last. Default: as it is.
    size
        Longest side of its box in metres. Default: as it is.
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    _viewer(port).place(name, position, rotation=rotation, size=size)
    return 0


def render(
    file: tyro.conf.Positional[Path],
    /,
    *,
    size: Size = None,
    frames: int = FRAMES,
    timeout: float = TIMEOUT_S,
    port: int | None = None,
) -> int:
    """Write the picture of a running viewer to a file, once it is refined.

    Parameters
    ----------
    file
        A .png file as displayed, or an .exr file of linear radiance.
    size
        Width and height in pixels. Default: the window's.
    frames
        Number of view frames to which it is refined.
    timeout
        Longest wait in seconds.
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    _viewer(port).render(file, size, frames=frames, timeout=timeout)
    return 0


def save(*, port: int | None = None) -> int:
    """Write the edits of a running viewer to its scene.toml.

    Parameters
    ----------
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    _viewer(port).save()
    return 0


def quit_(*, discard: bool = False, port: int | None = None) -> int:
    """Close a running viewer.

    Parameters
    ----------
    discard
        Close it even if edits are lost.
    port
        Port of the viewer's browsers, or the one that an error names. Default: the newest viewer.

    Returns
    -------
    int
        Exit status 0.
    """
    _viewer(port).quit(discard=discard)
    return 0


def _viewer(port: int | None) -> RemoteViewer:
    from iprt.viewer.program.client import connect_viewer

    return connect_viewer(port)
