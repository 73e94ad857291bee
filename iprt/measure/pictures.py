"""Scores of other renderers' pictures against a scene's truth."""

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
    """Map the expected file names to view and video frame.

    The picture of a view `table` is `table.exr`, and of frame 7 of a video `table.0007.exr`. Only
    frames with a truth are expected.
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
    """Find the pictures of a folder, and map each path to view and frame.

    Raises
    ------
    IprtError
        The folder does not exist, a picture is missing, or a file's name matches no view.
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
    """Score the pictures of a folder. Its name is reported as the method.

    Parameters
    ----------
    background : {"panorama", "truth"}
        Background of the pictures, for the report.

    Raises
    ------
    IprtError
        The folder or a target cannot be read (see `require_pictures` and `read_target`), or a
        picture is not an EXR file, differs from the truth in size, or contains NaN or infinity.
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
