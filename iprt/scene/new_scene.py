"""Creation of scene folders from pictures and video files."""

from __future__ import annotations

import logging
import re
from collections import Counter
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import tomlkit

from iprt.errors import FormatError, SceneError
from iprt.files.atomic import replacing, require_writable
from iprt.files.exr import exr_layers, layer_lines
from iprt.files.exr_layers import named_depth
from iprt.files.images import read_depth, read_normal
from iprt.files.kinds import FRAME_PATTERN, PICTURE_SUFFIXES, file_kind
from iprt.files.message_text import counted, printable
from iprt.files.safe_reading import anywhere, is_file
from iprt.footage.depth_summary import normal_warnings
from iprt.footage.prepare.reading import RawFrame, RawFrames, require_unit
from iprt.footage.video.container import is_container
from iprt.footage.video.depth_code import DepthCode
from iprt.footage.video.picture_tracks import frame_path
from iprt.footage.video.placement import Eye, Fit
from iprt.footage.video.source import FrameSource
from iprt.footage.video.video_table import VideoTable
from iprt.scene.manifest import MANIFEST_NAME, parse_manifest
from iprt.scene.manifest_writing import VIEW_SIZE, copied, table_text

LOG = logging.getLogger("iprt.scene")
MAX_LISTED = 100_000
"""Limit for the files of a folder that are listed."""
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*)")


def new_scene(
    folder: Path,
    color: Path,
    depth: Path | None,
    code: DepthCode,
    normal: Path | None,
    *,
    color_layer: str | None = None,
    depth_layer: str | None = None,
    eye: Eye | None = None,
    fit: Fit | None = None,
) -> int:
    """Create a scene folder with copies of the pictures and a scene.toml.

    Parameters
    ----------
    folder : Path
        Created if missing; must not hold a scene.
    color, depth : Path
        Pictures, printf patterns for the frames of a video, or video files. Without `depth`, the
        file of `color` holds it.
    code : DepthCode
        Encoding of stored depth; required for integers.
    normal : Path or None
        By default, layers of `color` named as normals that agree with depth.
    color_layer, depth_layer : str or None
        Layers of EXR files, for names that do not tell.
    eye, fit
        Half of a stereo picture to use, and how pictures that are not 2:1 cover the sphere.

    Returns
    -------
    int
        Number of frames.

    Raises
    ------
    SceneError, FormatError
        The scene cannot be created; nothing has been written.
    """
    if (folder / MANIFEST_NAME).exists():
        raise SceneError(f"{folder}: holds a scene already; choose another folder")
    require_writable(folder / MANIFEST_NAME)
    named = {"color": color, "depth": depth, "normal": normal}
    sources = {key: path for key, path in named.items() if path is not None}
    _require_sources(sources)
    numbers = picture_numbers(color)
    picture = frame_path(Path(), str(color), numbers[0])
    is_video = is_container(Path(), str(color))
    if depth is None and not is_video:
        _require_own_depth(color, picture, depth_layer)
        sources["depth"] = depth = color
    if depth is not None and not code.is_known:
        _require_floats(frame_path(Path(), str(depth), numbers[0]), depth_layer)
    choices = {"color_layer": color_layer, "depth_layer": depth_layer, "eye": eye, "fit": fit}
    chosen = {key: choice for key, choice in choices.items() if choice is not None}
    named_files = {key: str(path) for key, path in sources.items()}
    given = _video_table(
        named_files | chosen, code, None if is_video else (numbers[0], numbers[-1])
    )
    # Not validated as in a manifest: these paths may lead anywhere.
    source = FrameSource(Path(), VideoTable.model_construct(**given), anywhere(Path()))
    # Pictures numbered in regular steps become consecutive frames.
    there = source.indices if is_video else numbers
    frames = None if is_video else (numbers[0], numbers[0] + len(numbers) - 1)
    if numbers.step > 1:
        LOG.info(
            "%s: its numbers from %d to %d in steps of %d become frames %d to %d",
            *(color, numbers[0], numbers[-1], numbers.step, *(frames or ())),
        )
    for path in sources.values():
        files = (frame_path(Path(), str(path), number) for number in there)
        _require_frames(path, list(dict.fromkeys(files)))
    raw = RawFrames(source).read(source.indices[0])
    if normal is None and not is_video and _has_own_normals(picture, raw):
        sources["normal"] = color
    # A file shared with color is copied once.
    keys = {key: "color" if path == color else key for key, path in sources.items()}
    names = {key: _target_name(keys[key], path) for key, path in sources.items()}
    copies = {
        frame_path(folder, names[key], there[0] + place): frame_path(Path(), str(path), number)
        for key, path in sources.items()
        for place, number in enumerate(there)
    }
    copies = {target: file for target, file in copies.items() if is_file(file)}
    name = re.sub(r"[/\\\n]", "-", folder.resolve().name) or "scene"
    text = manifest_of(name, _video_table(names | chosen, code, frames))
    parse_manifest(text, str(folder / MANIFEST_NAME))
    with copied(copies), replacing(folder / MANIFEST_NAME) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return len(there)


def _require_floats(depth: Path, layer: str | None) -> None:
    """Raise SceneError if a depth file stores integers, whose unit is unknown."""
    if is_container(Path(), str(depth)) or read_depth(depth, layer)[1]:
        raise SceneError(
            f"{depth}: stores integers; give --depth-scale, the metres of one step "
            "(0.001 for millimetres), or --depth-range, the metres of black and of white"
        )


def _video_table(
    files: dict[str, str], code: DepthCode, frames: tuple[int, int] | None
) -> dict[str, Any]:
    """Return `[video]` with `files` and choices by key; video files give frames and rate."""
    table: dict[str, Any] = {**files}
    if code.scale is not None:
        table["depth_scale"] = code.scale
    if code.ends is not None:
        table |= {"depth_range": list(code.ends), "depth_encoding": code.encoding}
    if code.kind != "distance":
        table["depth_kind"] = code.kind
    if code.marks is not None:
        for key, values in (("invalid", code.marks.invalid), ("sky", code.marks.sky)):
            table[f"depth_{key}"] = [int(v) if v == v // 1 < 2**53 else v for v in values]
    if frames is not None:
        table |= {"frames": list(frames), "fps": 30.0}
    return table


def manifest_of(name: str, video: dict[str, Any]) -> str:
    """Return the text of a `scene.toml` with the table `[video]` and a view ahead."""
    document = tomlkit.document()
    document.update({"format": 1, "name": name, "exposure": 1.0, "video": video})
    document["exposure"].comment("display = sRGB of exposure times radiance")
    for key, comment in (
        ("depth_scale", "metres per stored unit"),
        ("depth_range", "metres of black and of white"),
    ):
        if key in video:
            document["video"][key].comment(comment)
    ahead = {"yaw_deg": 0.0, "pitch_deg": -15.0, "fov_y_deg": 75.0, "size": VIEW_SIZE}
    return tomlkit.dumps(document) + "\n" + table_text("views", name="ahead", **ahead)


def _target_name(key: str, path: Path) -> str:
    conversion = FRAME_PATTERN.search(path.name)
    number = f".{conversion[0]}" if conversion else ""
    return f"{key}{number}{path.suffix.lower()}"


def _require_sources(sources: dict[str, Path]) -> None:
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


def _require_own_depth(color: Path, picture: Path, layer: str | None) -> None:
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


def _has_own_normals(picture: Path, raw: RawFrame) -> bool:
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
            raise FormatError(f"{picture}: normals of another size than color")
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
        As in `_require_sources`.

    Raises
    ------
    SceneError, FormatError
        A file is missing or damaged.
    """
    _require_sources(sources)
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


def _require_frames(pattern: Path, files: list[Path]) -> None:
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
