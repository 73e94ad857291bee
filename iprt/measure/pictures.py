"""Pictures that others rendered, scored against a scene's truth as ours are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iprt.errors import FormatError, IprtError
from iprt.files.images import read_color
from iprt.files.kinds import file_kind
from iprt.measure.compare import Compared, Comparison, scored
from iprt.measure.view_truth import Background, Radiance, read_target, truth_indices

if TYPE_CHECKING:
    from iprt.scene.scene import Scene


def picture_names(scene: Scene, views: Sequence[str]) -> dict[str, tuple[str, int]]:
    """Names of the files to score, with the view and the number of the video's frame.

    A view `table` is in `table.exr`; of a video, frame 7, if it has a truth, in `table.0007.exr`.
    """
    moving = len(scene.frame_indices) > 1
    return {
        f"{view}.{index:04d}.exr" if moving else f"{view}.exr": (view, index)
        for view in views
        for index in truth_indices(scene, view)
    }


def require_pictures(
    scene: Scene, views: Sequence[str], folder: Path
) -> dict[Path, tuple[str, int]]:
    """The files of a folder, each with its view and frame.

    Raises
    ------
    IprtError
        There is no such folder, a picture is missing, or one has the name of no view.
    """
    if not folder.is_dir():
        raise IprtError(f"{folder}: there is no such folder of pictures")
    known = picture_names(scene, [name for name, view in scene.views.items() if view.truth])
    for file in sorted(folder.glob("*.exr")):
        if file.name not in known:
            names = ", ".join([*known][:3]) + (", ..." if len(known) > 3 else "")
            raise IprtError(f"{file}: is no view of {scene.name} with a truth; they are {names}")
    wanted = picture_names(scene, views)
    for name in wanted:
        if not (folder / name).is_file():
            raise IprtError(f"{folder / name}: there is no such picture; --view chooses others")
    return {folder / name: key for name, key in wanted.items()}


def compare_pictures(
    scene: Scene, views: Sequence[str], folder: Path, background: Background
) -> Iterator[Compared]:
    """Score the pictures of a folder, whose name stands for the method.

    Parameters
    ----------
    background : {"panorama", "truth"}
        What they were composited over, which the pictures cannot tell.

    Raises
    ------
    IprtError
        As `require_pictures` and `read_target`; or a picture has another size than the truth, holds
        NaN or infinity, or is no EXR.
    """
    method = folder.resolve().name
    moving = len(scene.frame_indices) > 1
    for path, (view, index) in require_pictures(scene, views, folder).items():
        target = read_target(scene, view, "panorama", index=index)
        color = _read(path, target.radiance.shape)
        label = f"{view} {index}" if moving else view
        scores = scored(target, color, f"picture {path}")
        comparison = Comparison(label, method, background, scores, {}, 0)
        yield Compared(comparison, replace(target, name=label), color)


def _read(path: Path, shape: tuple[int, ...]) -> Radiance:
    if file_kind(path) != "exr":
        raise FormatError(f"{path}: is no EXR picture; scores need linear radiance")
    color = read_color(path)
    if color.shape != shape:
        raise FormatError(
            f"{path}: {color.shape[1]}x{color.shape[0]} pixels, "
            f"but the truth has {shape[1]}x{shape[0]}"
        )
    if not np.isfinite(color).all():
        raise FormatError(f"{path}: holds NaN or infinite radiance")
    return color
