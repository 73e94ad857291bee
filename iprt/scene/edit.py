"""Creation of scene folders from pictures, and changes to them; writes are all or nothing."""

from __future__ import annotations

import fcntl
import filecmp
import logging
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.files.atomic import replacing, require_writable
from iprt.files.images import read_depth
from iprt.files.path_safety import anywhere
from iprt.files.problems import FRAME_PATTERN
from iprt.files.termination import undisturbed
from iprt.files.untrusted import is_file
from iprt.footage.prepare.reading import RawFrames
from iprt.footage.video.container import is_container
from iprt.footage.video.depth_code import DepthCode
from iprt.footage.video.picture_tracks import frame_path
from iprt.footage.video.placement import Eye, Fit
from iprt.footage.video.source import FrameSource
from iprt.footage.video.video_table import VideoTable
from iprt.geometry.mesh_files import MeshFile
from iprt.scene.manifest import MANIFEST_NAME, parse_manifest
from iprt.scene.sources import (
    has_own_normals,
    picture_numbers,
    require_frames,
    require_own_depth,
    require_sources,
)

LOG = logging.getLogger("iprt.scene")
VIEW_SIZE = (1024, 768)


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
    require_sources(sources)
    numbers = picture_numbers(color)
    picture = frame_path(Path(), str(color), numbers[0])
    is_video = is_container(Path(), str(color))
    if depth is None and not is_video:
        require_own_depth(color, picture, depth_layer)
        sources["depth"] = depth = color
    if depth is not None and not code.is_known:
        _require_floats(frame_path(Path(), str(depth), numbers[0]), depth_layer)
    choices = {"color_layer": color_layer, "depth_layer": depth_layer, "eye": eye, "fit": fit}
    chosen = {key: choice for key, choice in choices.items() if choice is not None}
    source = _source_of(sources, chosen, code, None if is_video else (numbers[0], numbers[-1]))
    # Pictures numbered in regular steps become consecutive frames.
    there = source.indices if is_video else numbers
    frames = None if is_video else (numbers[0], numbers[0] + len(numbers) - 1)
    if numbers.step > 1:
        LOG.info(
            "%s: its numbers from %d to %d in steps of %d become frames %d to %d",
            *(
                color,
                numbers[0],
                numbers[-1],
                numbers.step,
                numbers[0],
                len(there) - 1 + numbers[0],
            ),
        )
    for path in sources.values():
        named_files = (frame_path(Path(), str(path), number) for number in there)
        require_frames(path, list(dict.fromkeys(named_files)))
    raw = RawFrames(source).read(source.indices[0])
    if normal is None and not is_video and has_own_normals(picture, raw):
        sources["normal"] = color
    # A file shared with colour is copied once.
    keys = {key: "color" if path == color else key for key, path in sources.items()}
    names = {key: _target_name(keys[key], path) for key, path in sources.items()}
    copies = {
        frame_path(folder, names[key], there[0] + place): frame_path(Path(), str(path), number)
        for key, path in sources.items()
        for place, number in enumerate(there)
    }
    copies = {target: file for target, file in copies.items() if is_file(file)}
    name = re.sub(r"[/\\\n]", "-", folder.resolve().name) or "scene"
    text = _manifest_text(name, names | chosen, code, frames)
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


def _source_of(
    sources: Mapping[str, Path],
    chosen: Mapping[str, str],
    code: DepthCode,
    frames: tuple[int, int] | None,
) -> FrameSource:
    """Return the frame source of the new scene, reading the original files."""
    entries: dict[str, Any] = {
        **{key: str(path) for key, path in sources.items()},
        **chosen,
        "depth_scale": code.scale,
        "depth_range": None if code.ends is None else list(code.ends),
        "depth_encoding": code.encoding,
        "depth_kind": code.kind,
        "depth_invalid": None if code.marks is None else list(code.marks.invalid),
        "depth_sky": None if code.marks is None else list(code.marks.sky),
        "frames": None if frames is None else list(frames),
    }
    # Not validated as a manifest's table would be: these paths may lead anywhere.
    return FrameSource(Path(), VideoTable.model_construct(**entries), anywhere(Path()))


def parse_material(text: str) -> dict[str, Any]:
    """Parse a material into a manifest table.

    The forms are `diffuse:R,G,B`, `conductor:R,G,B[:ALPHA]`, `plastic:R,G,B[:ALPHA]` and `mirror`.

    Raises
    ------
    SceneError
        The text has another form or numbers outside [0, 1].
    """
    if text == "mirror":
        return {"kind": "conductor", "reflectance": [0.95, 0.95, 0.95], "alpha": 0.0}
    kind, *fields = text.split(":")
    most = {"diffuse": 1, "conductor": 2, "plastic": 2}.get(kind, 0)
    try:
        color = [float(value) for value in fields[0].split(",")]
        alpha = [float(value) for value in fields[1:]]
        if not (len(color) == 3 and 1 <= len(fields) <= most):
            raise ValueError
        if not all(0.0 <= value <= 1.0 for value in [*color, *alpha]):
            raise ValueError
    except (ValueError, IndexError):
        raise SceneError(
            f"--material {text}: expected diffuse:R,G,B or conductor:R,G,B:ALPHA or "
            "plastic:R,G,B:ALPHA with numbers from 0 to 1, or mirror"
        ) from None
    key = "reflectance" if kind == "conductor" else "albedo"
    return {"kind": kind, key: color} | ({"alpha": alpha[0]} if alpha else {})


@contextmanager
def copied(copies: dict[Path, Path]) -> Iterator[None]:
    """Copy files (target -> source), and delete the new ones if the block fails.

    Raises
    ------
    SceneError
        A different file has the target's name.
    """
    for target, source in copies.items():
        if target.exists() and not filecmp.cmp(source, target, shallow=False):
            raise SceneError(f"{target}: another file has this name; move it away first")
    folders = [folder for target in copies for folder in [target.parent, *target.parent.parents]]
    new_folders = list(dict.fromkeys(folder for folder in folders if not folder.exists()))
    new_files: list[Path] = []
    with undisturbed():
        try:
            for target, source in copies.items():
                if not target.exists():
                    new_files.append(target)
                    with replacing(target) as temporary:
                        shutil.copyfile(source, temporary)
            yield
        except BaseException:
            for file in new_files:
                with suppress(OSError):
                    file.unlink()
            for folder in sorted(new_folders, key=lambda path: -len(path.parts)):
                with suppress(OSError):
                    folder.rmdir()
            raise


@contextmanager
def changing(folder: Path) -> Iterator[None]:
    """Lock a scene folder against changes by other processes during the block.

    It waits for other processes. File systems without locks are not protected. A missing scene is
    left for the block to find.

    Raises
    ------
    SceneError
        scene.toml is read-only.
    """
    path = folder / MANIFEST_NAME
    with suppress(OSError):
        # In a writable folder even read-only files could be replaced.
        writable = path.stat().st_mode & 0o222 and os.access(path, os.W_OK)
        if not writable:
            raise SceneError(f"{path}: is read-only; make it writable to change the scene")
    handle = None
    try:
        with suppress(OSError):
            handle = os.open(folder, os.O_RDONLY)
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _target_name(key: str, path: Path) -> str:
    conversion = FRAME_PATTERN.search(path.name)
    number = f".{conversion[0]}" if conversion else ""
    return f"{key}{number}{path.suffix.lower()}"


def table_text(key: str, **values: Any) -> str:
    """Return an entry of a list of tables of `scene.toml`, of the values that are not None."""
    return tomlkit.dumps({key: [{k: v for k, v in values.items() if v is not None}]})


def matrix_array(to_world: NDArray[np.float64]) -> tomlkit.items.Array:
    """Return a (4, 4) transform as TOML, a row a line."""
    rows = tomlkit.array()
    for row in to_world:
        rows.add_line(*(float(f"{value:.7g}") for value in row), indent="  ")
    rows.add_line(indent="")
    return rows


def inline(values: Mapping[str, Any]) -> tomlkit.items.InlineTable:
    """Return a table in one line of TOML."""
    table = tomlkit.inline_table()
    table.update(values)
    return table


def _manifest_text(
    name: str, files: dict[str, str], code: DepthCode, frames: tuple[int, int] | None
) -> str:
    """Return a manifest with `files` and choices by key; video files give frames and rate."""
    document = tomlkit.document()
    document.update({"format": 1, "name": name, "exposure": 1.0})
    document["exposure"].comment("display = sRGB of exposure times radiance")
    video = tomlkit.table()
    video.update(files)
    if code.scale is not None:
        video["depth_scale"] = code.scale
        video["depth_scale"].comment("metres per stored unit")
    if code.ends is not None:
        video.update({"depth_range": list(code.ends), "depth_encoding": code.encoding})
        video["depth_range"].comment("metres of black and of white")
    if code.kind != "distance":
        video["depth_kind"] = code.kind
    if code.marks is not None:
        for key, values in (("invalid", code.marks.invalid), ("sky", code.marks.sky)):
            video[f"depth_{key}"] = [int(v) if v == v // 1 < 2**53 else v for v in values]
    if frames is not None:
        video.update({"frames": list(frames), "fps": 30.0})
    document["video"] = video
    ahead = {"yaw_deg": 0.0, "pitch_deg": -15.0, "fov_y_deg": 75.0, "size": VIEW_SIZE}
    return tomlkit.dumps(document) + "\n" + table_text("views", name="ahead", **ahead)


def object_text(
    name: str,
    mesh: str,
    to_world: NDArray[np.float64],
    material: dict[str, Any] | None,
    animation: str | int | None = None,
) -> str:
    """Return an `[[objects]]` table of `scene.toml`."""
    return table_text(
        "objects",
        name=name,
        mesh=mesh,
        to_world=matrix_array(to_world),
        animation=animation,
        material=None if material is None else inline(material),
    )


def outdate_truths(document: Any, names: Iterable[str]) -> bool:
    """Mark the truths of a `scene.toml` that show edited objects; return True if there are any.

    Parameters
    ----------
    document : tomlkit document
        The document before the edits.
    names : iterable of str
        Names of objects that are moved, painted, removed, or new.
    """
    edited, found = set(names), False
    for view in document.get("views", ()):
        if "truth" in view and not edited.isdisjoint(view.get("objects", edited)):
            view["truth_outdated"] = found = True
    return found


def mesh_copies(
    root: Path, file: MeshFile, name: str, others: Mapping[Path, Path] | None = None
) -> tuple[dict[Path, Path], str]:
    """Return the files to copy (target -> source), and the mesh's path in the manifest.

    Parameters
    ----------
    root : Path
        The scene's folder.
    name : str
        The object's name.
    others : mapping of Path to Path or None
        Other files that will be copied (target -> source).
    """
    mesh, references = file.path, dict.fromkeys(file.references.values())
    if mesh.resolve().is_relative_to(root.resolve()):
        return {}, mesh.resolve().relative_to(root.resolve()).as_posix()
    # Files that refer to each other share a folder, apart from equally named files of other meshes.
    folder, others = root / "meshes", others or {}
    there = {target: target for target in folder.iterdir()} if folder.is_dir() else {}
    there |= others
    inside = (target.relative_to(folder) for target in there if target.is_relative_to(folder))
    taken = {Path(path.parts[0]).stem for path in inside}
    if references:
        folder = folder / free_name(name, taken)
        target = folder / mesh.name
    else:
        target = folder / mesh.name
        if target in there and not filecmp.cmp(mesh, there[target], shallow=False):
            target = folder / (free_name(mesh.stem, taken) + mesh.suffix)
    copies = {target: mesh} | {folder / path: mesh.parent / path for path in references}
    return copies, target.relative_to(root).as_posix()


def free_name(wanted: str, taken: set[str]) -> str:
    """Return a valid name that is not taken, with a number if needed."""
    base = re.sub(r"[^\w. -]", "_", wanted).strip() or "object"
    number = 2
    name = base
    while name in taken:
        name = f"{base}-{number}"
        number += 1
    return name
