"""Whether the files that a scene names are there, and inside its folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

from iprt.errors import FormatError
from iprt.files.path_safety import require_inside
from iprt.files.untrusted import is_file
from iprt.footage.prepare.remarks import video_notices, video_problems
from iprt.footage.video.sequence import frame_path
from iprt.footage.video.source import FrameSource
from iprt.scene.manifest import MANIFEST_NAME, Manifest

MAX_TRIES = 10_000
"""Names of truths that are looked for in a scene without all its frames."""


class NamesFiles(Protocol):
    """The part of a `Scene` that files are found from."""

    root: Path
    manifest: Manifest
    within: Path
    source: FrameSource

    @property
    def frame_indices(self) -> Sequence[int]: ...


def missing_files(scene: NamesFiles, *, strict: bool = False) -> list[str]:
    """Files that are not there, or not inside; one line each.

    Only the first of a video's frames must be there, or all if `strict`.
    """
    frames = video_problems(scene.source, strict=strict)
    problems = [
        *frames,
        *(line for key, name in _files(scene) for line in _wrong(scene, key, name)),
    ]
    try:
        few = frames or video_notices(scene.source)
        tries = len(scene.frame_indices) * len(scene.manifest.views)
    except FormatError:  # reported above: without its files, a video has no frames
        return problems
    # Missing frames show how few there are, where a manifest would have us try many.
    for view in [] if few and tries > MAX_TRIES else scene.manifest.views:
        for key in ("truth", "truth_background", "truth_mask"):
            name = getattr(view, key)
            if name is not None:
                problems += _wrong_truth(scene, f"views.{view.name}.{key}", name)
    return problems


def made_of(scene: NamesFiles) -> set[Path]:
    """The manifest and all files that it names, but truths; some frames may be missing."""
    files = {scene.root / MANIFEST_NAME, *(scene.root / name for _, name in _files(scene))}
    if scene.manifest.video.poses is not None:
        files.add(scene.root / scene.manifest.video.poses)
    for index in scene.frame_indices:
        files.update(scene.source.files(index).values())
    return files


def _files(scene: NamesFiles) -> Iterator[tuple[str, str]]:
    """Key and name of each file besides frames and truths."""
    for table in scene.manifest.objects:
        yield f"objects.{table.name}.mesh", table.mesh
        texture = getattr(table.material, "texture", None)
        if texture is not None:
            yield f"objects.{table.name}.material.texture", texture
    for entry in scene.manifest.real_materials:
        if entry.mask is not None:
            yield f"real_materials.{entry.name}.mask", entry.mask


def _wrong(scene: NamesFiles, key: str, name: str) -> list[str]:
    """Faults of a file that must exist: at most one line."""
    if not is_file(scene.root / name):
        return [f"{key}: there is no file {name}"]
    try:
        require_inside(scene.root / name, scene.within)
    except FormatError as error:
        return [f"{key}: {error}"]
    return []


def _wrong_truth(scene: NamesFiles, key: str, pattern: str) -> list[str]:
    """As `_wrong`; of a video, some frames may have no truth."""
    files = dict.fromkeys(frame_path(scene.root, pattern, i) for i in scene.frame_indices)
    there = [str(file.relative_to(scene.root)) for file in files if is_file(file)]
    if not there:
        return [f"{key}: there is no file {pattern}"]
    return [line for name in there for line in _wrong(scene, key, name)][:1]
