"""Source files of a new scene: checks of their names, and their layers."""

from __future__ import annotations

import logging
import re
from collections import Counter
from itertools import islice, pairwise
from pathlib import Path

from iprt.errors import FormatError, SceneError
from iprt.files.exr import exr_layers, layer_lines
from iprt.files.exr_layers import named_depth
from iprt.files.images import read_normal
from iprt.files.kinds import file_kind
from iprt.files.problems import FRAME_PATTERN, PICTURE_SUFFIXES
from iprt.files.toml_text import printable
from iprt.files.untrusted import is_file
from iprt.files.wording import counted
from iprt.footage.depth_summary import normal_warnings
from iprt.footage.prepare.reading import RawFrame, require_unit
from iprt.footage.video.container import is_container
from iprt.footage.video.picture_tracks import frame_path

LOG = logging.getLogger("iprt.scene")
MAX_LISTED = 100_000
"""Limit for the files of a folder that are listed."""
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*)")


def require_sources(sources: dict[str, Path]) -> None:
    """Raise SceneError for folders and missing files.

    Parameters
    ----------
    sources : dict of str to Path
        By flag without dashes: color, and depth and normal if given.
    """
    for key, path in sources.items():
        if path.is_dir():
            pattern = pattern_in(path)
            raise SceneError(
                f"--{key} {path}: is a folder; name a picture or a video file in it"
                if pattern is None
                else f"--{key} {path}: is a folder; its numbered pictures are named by a pattern: "
                f"--{key} {path / pattern}"
            )
        if not FRAME_PATTERN.search(path.name) and not is_file(path):
            raise SceneError(f"--{key} {path}: no such file")


def require_own_depth(color: Path, picture: Path, layer: str | None) -> None:
    """Raise SceneError unless an EXR picture holds a layer named as depth.

    Parameters
    ----------
    color : Path
        The argument, possibly a pattern.
    picture : Path
        The first picture.
    layer : str or None
        The layer chosen as depth.
    """
    layers = exr_layers(picture) if file_kind(picture) == "exr" else []
    if layers and (layer is not None or named_depth(layers)):
        return
    unknown = [entry.name for entry in layers if entry.is_single and not entry.meaning]
    hint = f"; or, of its layers, --depth-layer {unknown[0]} names one" if unknown else ""
    raise SceneError(
        f"--depth is missing: {color} is a picture and holds no depth; give a picture of depth "
        "of the same view: EXR or PFM in metres, or 16-bit grey PNG with --depth-scale "
        f"(docs/footage.md names programs that estimate depth){printable(hint)}"
    )


def has_own_normals(picture: Path, raw: RawFrame) -> bool:
    """Return True if an EXR picture has layers named as normals that agree with its depth.

    If they disagree, a warning is logged: some programs write normals in other axes.

    Parameters
    ----------
    picture : Path
        The picture of the first frame.
    raw : RawFrame
        The first frame.
    """
    if file_kind(picture) != "exr":
        return False
    if all(layer.meaning != "normals" for layer in exr_layers(picture)):
        return False
    try:
        normal = read_normal(picture)
        require_unit(picture, normal)
        if normal.shape != raw.color.shape:
            raise FormatError(f"{picture}: normals of another size than colour")
        problems = [f"{picture}: normals {phrase}" for phrase in normal_warnings(normal, raw.depth)]
    except FormatError as error:
        problems = [str(error)]
    if problems:
        reason = problems[0].partition(";")[0]
        LOG.warning("%s; they are left out, and normals are fitted to depth", reason)
    return not problems


def layer_lists(sources: dict[str, Path]) -> list[str]:
    """List the layers of each file, a line each; the first file represents a pattern.

    Parameters
    ----------
    sources : dict of str to Path
        As in `require_sources`.

    Raises
    ------
    SceneError, FormatError
        A file is missing or damaged.
    """
    require_sources(sources)
    firsts = [frame_path(Path(), str(path), picture_numbers(path)[0]) for path in sources.values()]
    lines = []
    for path in dict.fromkeys(firsts):
        is_exr = not is_container(Path(), str(path)) and file_kind(path) == "exr"
        lines += layer_lines(path) if is_exr else [f"{path}: no layers, for it is no EXR file"]
    return lines


def picture_numbers(color: Path) -> range:
    """Return the frame numbers of a printf pattern as found on disk; 0 for a single picture.

    If the numbers rise in regular steps, the range has this step. Otherwise every number between
    the first and the last is a frame.

    Raises
    ------
    FormatError
        No file matches the pattern.
    """
    conversion = FRAME_PATTERN.search(color.name)
    if conversion is None:
        return range(1)
    before, after = color.name[: conversion.start()], color.name[conversion.end() :]
    matcher = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
    siblings = color.parent.iterdir() if color.parent.is_dir() else iter(())
    found = [int(match[1]) for path in siblings if (match := matcher.fullmatch(path.name))]
    # A file with another padding, such as 7 for a pattern with 007, is no frame.
    numbers = sorted({n for n in found if is_file(frame_path(Path(), str(color), n))})
    if not numbers:
        raise FormatError(f"{color}: no file matches this pattern")
    steps = {later - number for number, later in pairwise(numbers)} or {1}
    return range(numbers[0], numbers[-1] + 1, steps.pop() if len(steps) == 1 else 1)


def require_frames(pattern: Path, files: list[Path]) -> None:
    """Raise SceneError if the first or most of the files of a pattern are missing.

    Other gaps, which the video reader bridges, are logged as a warning.
    """
    missing = [file for file in files if not is_file(file)]
    if not missing:
        return
    more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
    what = f"{pattern}: of {counted(len(files), 'picture')}, {missing[0].name}{more} missing"
    if missing[0] == files[0] or 2 * len(missing) > len(files):
        raise SceneError(
            f"{what}; number the pictures of all kinds alike, one by one or in regular steps"
        )
    LOG.warning("%s; the one before each gap stays", what)


def pattern_in(folder: Path) -> str | None:
    """Return the printf pattern of most numbered pictures in a folder, or None without any."""
    found: Counter[str] = Counter()
    for path in islice(folder.iterdir(), MAX_LISTED):
        match = _NUMBERED.fullmatch(path.stem)
        if match is None or path.suffix.lower() not in PICTURE_SUFFIXES:
            continue
        before, number, after = match.groups()
        padded = number.startswith("0") and 1 < len(number) < 10
        found[f"{before}%{f'0{len(number)}' if padded else ''}d{after}{path.suffix}"] += 1
    # Numbers without a leading zero may still be padded: color.0999.png, color.1000.png.
    for name in [name for name in found if "%0" in name]:
        found[name] += found.get(re.sub(r"%0\d", "%", name), 0)
    (best, count), *_ = found.most_common(1) or [("", 0)]
    return best if count > 1 else None
