"""Containment of a scene's files in its folder; links that lead out of it need permission."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath, PureWindowsPath

from iprt.errors import FormatError


def stays_inside(name: str) -> bool:
    """Return True if a relative path, with slashes or backslashes, never leaves its folder."""
    path = PurePosixPath(name.replace("\\", "/"))
    depth = 0
    for part in path.parts:
        depth += -1 if part == ".." else 1
        if depth < 0:
            return False
    return not path.is_absolute() and not PureWindowsPath(name).drive


def require_inside(path: Path, folder: Path) -> None:
    """Raise FormatError unless `path`, with links resolved, lies in `folder`.

    The root of the file system as `folder` permits everything.
    """
    real, home = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    if not real.is_relative_to(home):
        raise FormatError(
            f"{path}: is a link to {real}, outside its folder; copy it there, or give "
            "--allow-outside"
        )


def anywhere(folder: Path) -> Path:
    """Return a folder for `require_inside` that permits every file."""
    return Path(Path(os.path.realpath(folder)).anchor)
