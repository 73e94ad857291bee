"""A scene as a USD stage with its pictures: written whole or not at all."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Kind, Tf, Usd, UsdGeom, UsdUtils

from iprt import __version__
from iprt.errors import FormatError
from iprt.files.atomic import require_regular
from iprt.files.message_text import printable
from iprt.files.termination import at_termination
from iprt.footage.frame import Frame
from iprt.output.usd.lights import write_dome, write_sun
from iprt.output.usd.materials import MaterialWriter
from iprt.output.usd.objects import Times, write_objects
from iprt.output.usd.pictures import Pictures
from iprt.output.usd.prims import place, usable_name
from iprt.output.usd.room import write_room
from iprt.output.usd.views import write_views
from iprt.scene.scene import Scene

PACKAGE = ".usdz"


def pictures_folder(path: Path) -> Path:
    """Return the folder for the pictures of a stage, beside it."""
    return path.with_name(f"{path.stem}_pictures")


def write_scene(scene: Scene, path: Path, index: int, size: tuple[int, int]) -> list[str]:
    """Write a scene as a USD stage, with a folder of pictures unless it is a package.

    Parameters
    ----------
    path : Path
        .usd, .usda, .usdc or .usdz; an existing file is replaced.
    index : int
        Frame of the video that gives the surfaces and the dome.
    size : (width, height)
        Largest number of columns and rows of the mesh of surfaces.

    Returns
    -------
    list of str
        Losses, a phrase each.

    Raises
    ------
    FormatError
        A frame or a mesh cannot be read, or the files cannot be written.
    """
    frame = scene.frame(index)
    delegate = UsdUtils.CoalescingDiagnosticDelegate()  # without it, USD prints its warnings
    with _staged(path) as folder:
        pictures = Pictures(folder / pictures_folder(path).name)
        stage = Usd.Stage.CreateInMemory()
        lost = _fill(stage, scene, frame, size, pictures)
        is_package = path.suffix.lower() == PACKAGE
        target = folder / (f"{path.stem}.usdc" if is_package else path.name)
        try:
            done = stage.GetRootLayer().Export(str(target))
            if is_package:
                done = done and UsdUtils.CreateNewUsdzPackage(str(target), str(folder / path.name))
        except Tf.ErrorException as error:
            raise FormatError(f"{path}: cannot be written ({_reason(error)})") from error
        if not done:
            raise FormatError(f"{path}: cannot be written by USD")
    delegate.TakeUncoalescedDiagnostics()
    return lost


def _fill(
    stage: Any, scene: Scene, frame: Frame, size: tuple[int, int], pictures: Pictures
) -> list[str]:
    """Write all prims to an empty stage, and return the losses."""
    now = scene.time_of(frame.index)
    times: Times = []
    if len(scene.frame_indices) > 1:
        times = [(index, scene.time_of(index)) for index in scene.frame_indices]
        stage.SetTimeCodesPerSecond(scene.source.fps)
        stage.SetFramesPerSecond(scene.source.fps)
        stage.SetStartTimeCode(times[0][0])
        stage.SetEndTimeCode(times[-1][0])
    stage.GetRootLayer().documentation = (
        f"Frame {frame.index} of {scene.name}, by iprt {__version__}. Colors are linear; they are "
        f"displayed at {scene.exposure:g} times their values."
    )
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    name = f"/{usable_name(scene.name)}"
    root = UsdGeom.Xform.Define(stage, name).GetPrim()
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    stage.SetDefaultPrim(root)
    materials = MaterialWriter(stage, f"{name}/materials", pictures)
    UsdGeom.Scope.Define(stage, f"{name}/materials")
    UsdGeom.Scope.Define(stage, f"{name}/objects")
    write_objects(stage, f"{name}/objects", scene.objects, materials, now, times)
    file = pictures.radiance("panorama", frame.radiance)
    captured = UsdGeom.Xform.Define(stage, f"{name}/captured")
    place(captured, _pose(frame.pose))
    write_room(stage, f"{name}/captured", frame, size, file)
    write_dome(stage, f"{name}/captured/panorama", file)
    cameras = UsdGeom.Xform.Define(stage, f"{name}/views")
    moves = bool(times) and scene.source.pose(times[0][0]) is not None
    poses = ((code, _pose(scene.source.pose(code))) for code, _ in times if moves)
    place(cameras, _pose(frame.pose), poses)
    write_views(stage, f"{name}/views", scene.views.values(), now, times)
    if frame.sun is not None:
        write_sun(stage, f"{name}/sun", frame.sun)
    return list(materials.lost)


def _pose(pose: NDArray[np.float64] | None) -> NDArray[np.float64]:
    return np.eye(4) if pose is None else pose


@contextmanager
def _staged(path: Path) -> Iterator[Path]:
    """Yield a new folder beside `path`, whose files are moved to their places on success.

    The stage comes last, so that there never is one without its pictures.
    """
    temporary, pictures = path.with_name(f".{uuid.uuid4().hex}.tmp"), pictures_folder(path)

    def remove() -> None:
        shutil.rmtree(temporary, ignore_errors=True)

    try:
        with at_termination(remove):
            try:
                temporary.mkdir(parents=True)
                yield temporary
                made = sorted((temporary / pictures.name).glob("*"))
                made = [] if path.suffix.lower() == PACKAGE else made
                moves = {file: pictures / file.name for file in made}
                for target in (path, *moves.values()):
                    require_regular(target)
                if moves:
                    pictures.mkdir(exist_ok=True)
                for source, target in (*moves.items(), (temporary / path.name, path)):
                    os.replace(source, target)
            finally:
                remove()
    except OSError as error:
        raise FormatError(f"{path}: cannot be written: {error.strerror}") from error
    except FormatError as error:  # of a file that would have been moved
        raise FormatError(str(error).replace(str(temporary), str(path.parent))) from error


def _reason(error: Exception) -> str:
    """Return an error of USD in one line, without places in its own code."""
    text = " ".join(str(error).split())
    _, colon, told = text.partition(" : '")
    return printable(told.rstrip("'") if colon else text, 200)
