"""Which files a scene is made of, and whether they were written again."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from iprt.errors import IprtError
from iprt.files.problems import FRAME_PATTERN
from iprt.footage.video.sequence import frame_path
from iprt.geometry.mesh_files import MeshFile
from iprt.scene.manifest import MANIFEST_NAME, Manifest, read_manifest

MOST_FRAMES = 64
"""Frames of a video of pictures that are watched, from the first on."""

State = tuple[int, int, int] | None
"""Time, size and number of a file; None: there is none."""
Stamp = tuple[tuple[Path, State], ...]
"""States of the files that frames are made of."""


class Watch:
    """Tells when files of a scene were written again.

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
        """Take note of the files that the manifest names now, before they are read."""
        path = self._root / MANIFEST_NAME
        before = _state(path)
        try:
            manifest = read_manifest(path)
        except IprtError:
            # Those that it named before are still shown.
            self._seen = {**{file: _state(file) for file in self._seen}, path: before}
            return ()
        frames = _frame_files(self._root, manifest)
        stamp = tuple((file, _state(file)) for file in sorted(frames))
        others = self._object_files(manifest)
        self._seen = {**{file: _state(file) for file in others}, **dict(stamp), path: before}
        return stamp

    def changed(self) -> bool:
        """Since `look` or the last call. That a file is gone, as editors have it for a moment, does
        not count.
        """
        now = {file: _state(file) for file in self._seen}
        written = [file for file in now if now[file] not in (None, self._seen[file])]
        self._seen.update((file, now[file]) for file in written)
        return bool(written)

    def _object_files(self, manifest: Manifest) -> set[Path]:
        """Meshes, what these refer to, and textures."""
        files = set()
        for table in manifest.objects:
            mesh = self._root / table.mesh
            files |= {mesh, *self._referred(mesh)}
            texture = getattr(table.material, "texture", None)
            if texture is not None:
                files.add(self._root / texture)
        return files

    def _referred(self, mesh: Path) -> Iterable[Path]:
        """Files that a mesh refers to; while they are damaged, those that it did before."""
        if mesh.suffix.lower() in (".obj", ".gltf"):
            with suppress(IprtError):
                referred = MeshFile(mesh).references.values()
                self._references[mesh] = frozenset(mesh.parent / path for path in referred)
        return self._references.get(mesh, ())


def _frame_files(root: Path, manifest: Manifest) -> set[Path]:
    """Pictures or video files, poses, and the masks of glossy surfaces."""
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
