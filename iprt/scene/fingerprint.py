"""A fingerprint of a scene, to tell whether results still match it."""

from __future__ import annotations

import hashlib
from contextlib import suppress

from iprt.scene.manifest import MANIFEST_NAME
from iprt.scene.scene import Scene
from iprt.scene.scene_files import made_of

DIGITS = 16
READING = 2
"""Raise this when files are read differently, for example meshes with other normals."""


def fingerprint(scene: Scene) -> str:
    """Return digits that change with the manifest, its files, or the way they are read.

    Files are compared by size and modification time, and are not read.
    """
    digest = hashlib.sha256(f"{READING} {scene.manifest.model_dump_json()}".encode())
    for file in sorted(made_of(scene) - {scene.root / MANIFEST_NAME}):
        with suppress(FileNotFoundError):  # frames of a video may be missing
            status = file.stat()
            digest.update(f"\n{file.name} {status.st_size} {status.st_mtime_ns}".encode())
    return digest.hexdigest()[:DIGITS]
