"""Detection of changes to a scene's files."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from iprt.errors import IprtError
from iprt.files.kinds import FRAME_PATTERN
from iprt.footage.video.picture_tracks import frame_path
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.usd_data import USD_SUFFIXES
from iprt.scene.manifest import MANIFEST_NAME, Manifest, read_manifest

MOST_FRAMES = 64
"""Number of first frames to watch in a video of pictures."""

State = tuple[int, int, int] | None
"""Time, size and inode of a file; None for a missing file."""
Stamp = tuple[tuple[Path, State], ...]
"""States of the files of the frames."""


class Watch:
    """A detector of changes to a scene's files.

    Parameters
    ----------
    root : Path
        The scene's folder.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._seen: dict[Path, State] = {}
        self._references: dict[Path, frozenset[Path]] = {}

    def look(self) -> Stamp:
        """Record the states of the files that the manifest names, before they are read."""
        path = self._root / MANIFEST_NAME
        before = _state(path)
        try:
            manifest = read_manifest(path)
        except IprtError:
            # The previously named files are still shown.
            self._seen = {**{file: _state(file) for file in self._seen}, path: before}
            return ()
        frames = _frame_files(self._root, manifest)
        stamp = tuple((file, _state(file)) for file in sorted(frames))
        others = self._object_files(manifest)
        self._seen = {**{file: _state(file) for file in others}, **dict(stamp), path: before}
        return stamp

    def changed(self) -> bool:
        """Return True if a file was written since `look` or the last call.

        A missing file does not count, because editors remove files for a moment while saving.
        """
        now = {file: _state(file) for file in self._seen}
        written = [file for file in now if now[file] not in (None, self._seen[file])]
        self._seen.update((file, now[file]) for file in written)
        return bool(written)

    def _object_files(self, manifest: Manifest) -> set[Path]:
        """Return meshes, the files that they refer to, and textures."""
        files = set()
        for table in manifest.objects:
            if table.mesh is not None:
                mesh = self._root / table.mesh
                files |= {mesh, *self._referred(mesh)}
            maps = {} if table.material is None else table.material.maps
            named = *maps.values(), getattr(table.light, "profile", None)
            files |= {self._root / name for name in named if name is not None}
        return files

    def _referred(self, mesh: Path) -> Iterable[Path]:
        """Return the files that a mesh refers to; for a damaged mesh, the last known ones."""
        if mesh.suffix.lower() in (".obj", ".gltf", *USD_SUFFIXES[:-1]):
            with suppress(IprtError):
                referred = MeshFile(mesh).references.values()
                self._references[mesh] = frozenset(mesh.parent / path for path in referred)
        return self._references.get(mesh, ())


def _frame_files(root: Path, manifest: Manifest) -> set[Path]:
    """Return pictures or video files, poses, and the masks of glossy surfaces."""
    video = manifest.video
    first, last = video.frames or (0, 0)
    indices = range(first, min(last, first + MOST_FRAMES - 1) + 1)
    files = {root / table.mask for table in manifest.real_materials if table.mask is not None}
    for name in (video.color, video.depth, video.normal, video.poses):
        if name is not None and FRAME_PATTERN.search(name):
            files |= {frame_path(root, name, index) for index in indices}
        elif name is not None:
            files.add(root / name)
    return files


def _state(path: Path) -> State:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
