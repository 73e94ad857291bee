"""The files of a scene: whether they exist and lie in its folder, and a fingerprint of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from iprt.errors import FormatError
from iprt.files.safe_reading import is_file, require_inside
from iprt.footage.prepare.remarks import video_notices, video_problems
from iprt.footage.video.picture_tracks import frame_path
from iprt.footage.video.source import FrameSource
from iprt.scene.manifest import MANIFEST_NAME, Manifest

DIGITS = 16
READING = 2
"""Raise this when files are read differently, for example meshes with other normals."""
MAX_TRIES = 10_000
"""Limit for the truth files to look for in a scene with missing frames."""


class NamesFiles(Protocol):
    """The attributes of a `Scene` that name its files."""

    root: Path
    manifest: Manifest
    within: Path
    source: FrameSource

    @property
    def frame_indices(self) -> Sequence[int]:
        """Numbers of the video's frames."""


def missing_files(scene: NamesFiles, *, strict: bool = False) -> list[str]:
    """Return the missing files and the files outside the folder, one line each.

    Of a video's frames only the first must exist, or all if `strict`.
    """
    frames = video_problems(scene.source, strict=strict)
    problems = [
        *frames,
        *(line for key, name in _files(scene) for line in _wrong(scene, key, name)),
    ]
    try:
        few = frames or video_notices(scene.source)
        tries = len(scene.frame_indices) * len(scene.manifest.views)
    except FormatError:  # reported above
        return problems
    # With missing frames, a manifest could demand any number of look-ups for truths.
    for view in [] if few and tries > MAX_TRIES else scene.manifest.views:
        for key in ("truth", "truth_background", "truth_mask"):
            name = getattr(view, key)
            if name is not None:
                problems += _wrong_truth(scene, f"views.{view.name}.{key}", name)
    return problems


def input_files(scene: NamesFiles) -> set[Path]:
    """Return the manifest and all files that it names except truths; frames may be missing."""
    files = {scene.root / MANIFEST_NAME, *(scene.root / name for _, name in _files(scene))}
    if scene.manifest.video.poses is not None:
        files.add(scene.root / scene.manifest.video.poses)
    for index in scene.frame_indices:
        files.update(scene.source.files(index).values())
    return files


def _files(scene: NamesFiles) -> Iterator[tuple[str, str]]:
    """Yield the key and name of each file other than frames and truths."""
    for table in scene.manifest.objects:
        if table.mesh is not None:
            yield f"objects.{table.name}.mesh", table.mesh
        profile = getattr(table.light, "profile", None)
        if profile is not None:
            yield f"objects.{table.name}.light.profile", profile
        maps = {} if table.material is None else table.material.maps
        for key, name in maps.items():
            yield f"objects.{table.name}.material.{key}", name
    for entry in scene.manifest.real_materials:
        if entry.mask is not None:
            yield f"real_materials.{entry.name}.mask", entry.mask


def _wrong(scene: NamesFiles, key: str, name: str) -> list[str]:
    """Return the fault of a file that must exist, in at most one line."""
    if not is_file(scene.root / name):
        return [f"{key}: there is no file {name}"]
    try:
        require_inside(scene.root / name, scene.within)
    except FormatError as error:
        return [f"{key}: {error}"]
    return []


def _wrong_truth(scene: NamesFiles, key: str, pattern: str) -> list[str]:
    """Return the fault of a truth like `_wrong`; some frames of a video may lack one."""
    files = dict.fromkeys(frame_path(scene.root, pattern, i) for i in scene.frame_indices)
    there = [str(file.relative_to(scene.root)) for file in files if is_file(file)]
    if not there:
        return [f"{key}: there is no file {pattern}"]
    return [line for name in there for line in _wrong(scene, key, name)][:1]


def fingerprint(scene: NamesFiles) -> str:
    """Return digits that change with the manifest, its files, or the way they are read.

    Files are compared by size and modification time, and are not read.
    """
    digest = hashlib.sha256(f"{READING} {scene.manifest.model_dump_json()}".encode())
    for file in sorted(input_files(scene) - {scene.root / MANIFEST_NAME}):
        with suppress(FileNotFoundError):  # frames of a video may be missing
            status = file.stat()
            digest.update(f"\n{file.name} {status.st_size} {status.st_mtime_ns}".encode())
    return digest.hexdigest()[:DIGITS]
