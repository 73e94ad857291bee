"""Provenance of figures: the version of `docs/protocol.md`, and a hash of the scene."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import iprt
from iprt.footage.video.picture_tracks import frame_path
from iprt.scene.manifest import MANIFEST_NAME
from iprt.scene.scene_files import input_files

if TYPE_CHECKING:
    from iprt.scene.scene import Scene

VERSION = 1
"""Version of the protocol. Raise it with every change that affects a figure."""
DIGITS = 16
_TRUTHS = ("truth", "truth_background", "truth_mask")


def scene_hash(scene: Scene) -> str:
    """Hash the contents of a scene that comparisons depend on, as `DIGITS` hexadecimal digits.

    The hash covers the parsed manifest without name and settings, and the bytes of all files that
    it names, including truths. Copies of a scene have the same hash on any machine.
    """
    # Without defaults, so that a new key of the format changes no hash.
    text = scene.manifest.model_dump_json(exclude={"name", "settings"}, exclude_defaults=True)
    digest = hashlib.sha256(text.encode())
    for file in sorted(input_files(scene) | _truths(scene)):
        if file.is_file() and file.name != MANIFEST_NAME:
            with file.open("rb") as opened:
                content = hashlib.file_digest(opened, "sha256").hexdigest()
            digest.update(f"\n{file.relative_to(scene.root).as_posix()} {content}".encode())
    return digest.hexdigest()[:DIGITS]


def provenance(scene: Scene) -> dict[str, Any]:
    """Return the provenance of a result as plain data."""
    return {
        "protocol": VERSION,
        "scene": scene.name,
        "scene_hash": scene_hash(scene),
        "iprt": iprt.__version__,
    }


def provenance_line(found: dict[str, Any]) -> str:
    """Format a provenance for tables and pages."""
    return (
        f"Protocol {found['protocol']}, scene {found['scene']} ({found['scene_hash']}), "
        f"iprt {found['iprt']}."
    )


def _truths(scene: Scene) -> set[Path]:
    patterns = [
        str(path.relative_to(scene.root))
        for view in scene.views.values()
        for path in (getattr(view, key) for key in _TRUTHS)
        if path is not None
    ]
    return {frame_path(scene.root, p, i) for p in patterns for i in scene.frame_indices}
