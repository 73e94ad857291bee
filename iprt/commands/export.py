"""`iprt export`: a scene with its objects as a file for other programs."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated

import tyro

from iprt.commands.flag_types import Size
from iprt.errors import IprtError

MESH_SIZE = (512, 256)
LEAST_SIZE, MOST_SIZE = 8, 4096

LOG = logging.getLogger("iprt.export")


def export(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=("-o",))],
    frame: int | None = None,
    size: Size = None,
    allow_outside: bool = False,
) -> int:
    """Export a scene with its objects to USD, for Blender, Houdini or Unreal.

    The stage holds the objects with their materials and motion, the views as cameras, the visible
    surfaces of one frame as a mesh that shows the panorama, the panorama as a dome light, and the
    sun. Pictures are written to a folder beside the file. Needs the extra `usd`: pip install
    'iprt[usd]'.

    Parameters
    ----------
    scene
        Scene folder.
    output
        File to write: .usda, .usdc, .usd, or .usdz, which holds the pictures too.
    frame
        Frame of the video that gives the surfaces and the panorama. Default: the first.
    size
        Most columns and rows of the mesh of surfaces. Default: 512 256.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.files.atomic import require_writable
    from iprt.geometry.usd_data import USD_SUFFIXES
    from iprt.geometry.usd_file import require_usd

    width, height = size or MESH_SIZE
    if not all(LEAST_SIZE <= side <= MOST_SIZE for side in (width, height)):
        raise IprtError(f"--size {width} {height}: expected {LEAST_SIZE} to {MOST_SIZE}")
    if output.suffix.lower() not in USD_SUFFIXES:
        kinds = ", ".join(USD_SUFFIXES)
        raise IprtError(f"{output}: unknown format '{output.suffix}'; supported: {kinds}")
    require_usd(output)
    require_writable(output)

    from iprt.commands.standard_streams import reporting
    from iprt.files.lock import locked
    from iprt.output.usd.stage import pictures_folder, write_scene
    from iprt.scene.scene import Scene

    opened = Scene.open(scene, allow_outside=allow_outside)
    pictures = pictures_folder(output)
    opened.require_not_ours(output, pictures)
    if pictures.is_symlink() or (pictures.exists() and not pictures.is_dir()):
        raise IprtError(f"{pictures}: is no folder; its name is needed for pictures")
    chosen = opened.frame_indices[0] if frame is None else frame
    with locked(output.parent):
        lost = write_scene(opened, output, chosen, (width, height))
    for phrase in lost:
        LOG.warning("%s: not written: %s", output, phrase)
    with reporting(f"{output} has been written nevertheless"):
        print(output)
    return 0
