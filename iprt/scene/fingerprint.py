"""Whether a scene is still the one that something was made from."""

from __future__ import annotations

import hashlib
from contextlib import suppress

from iprt.scene.manifest import MANIFEST_NAME
from iprt.scene.scene import Scene
from iprt.scene.scene_files import made_of

DIGITS = 16
READING = 2
"""To be raised when files are read in another way, such as meshes with other normals."""


def fingerprint(scene: Scene) -> str:
    """Digits that are others once the manifest says something else, or a file was written again
    or is read in another way.

    Files are judged by their size and time, and are not read.
    """
    digest = hashlib.sha256(f"{READING} {scene.manifest.model_dump_json()}".encode())
    for file in sorted(made_of(scene) - {scene.root / MANIFEST_NAME}):
        with suppress(FileNotFoundError):  # frames of a video may be missing
            status = file.stat()
            digest.update(f"\n{file.name} {status.st_size} {status.st_mtime_ns}".encode())
    return digest.hexdigest()[:DIGITS]
