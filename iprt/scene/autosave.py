"""Unsaved edits in a folder of the scene's, which outlive a viewer that is killed.

Each viewer has a folder in `AUTOSAVE_NAME`, which it locks while it lives. A folder that can be
locked is left from one that ended. Its file `EDITS` holds the text of `scene.toml` without and with
the edits, and is replaced as a whole. The text names the files of new objects in that folder. A
folder without that file is rubbish.
"""

from __future__ import annotations

import os
import re
import shutil
import socket
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Literal, Self

from pydantic import ValidationError

from iprt.errors import FormatError, SceneError
from iprt.files.atomic import replacing
from iprt.files.lock import locked
from iprt.files.message_text import printable
from iprt.files.safe_reading import read_bytes
from iprt.files.toml_tables import Table
from iprt.files.toml_text import MAX_BYTES
from iprt.scene.manifest import AUTOSAVE_NAME, Manifest, parse_manifest

EDITS = "edits.json"
MOST_BYTES = 8 * MAX_BYTES
"""Limit for the size of `EDITS`: JSON takes up to six bytes for a byte of a text."""
TAKEN = "has these edits; save or discard them there"
MOST_FOLDERS = 256
"""Limit for the folders that are looked at, newest first."""


class _Texts(Table):
    """The contents of `EDITS`."""

    format: Literal[1]
    base: str
    text: str


class Autosave:
    """A locked folder for the unsaved edits of one viewer.

    Parameters
    ----------
    folder : Path
        It is created if missing.

    Raises
    ------
    FormatError
        Another viewer holds the folder, or it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        if folder.parent.is_symlink() or folder.is_symlink():
            raise FormatError(f"{folder}: a link leads there; delete it")
        self.folder = folder
        self._lock = ExitStack()
        self._lock.enter_context(locked(folder, TAKEN))

    @classmethod
    def new(cls, root: Path) -> Self:
        """Return a new folder for a scene's edits."""
        host = re.sub(r"[^\w.-]", "_", socket.gethostname())
        names = (f"{host}-{os.getpid()}-{number}" for number in count(1))
        folders = (root / AUTOSAVE_NAME / name for name in names)
        return cls(next(folder for folder in folders if not folder.exists()))

    def copy(self, files: Mapping[Path, Path]) -> None:
        """Copy files (target -> source) that it does not have yet.

        Raises
        ------
        FormatError
            A file cannot be written.
        """
        for target, source in files.items():
            if not target.exists():
                with replacing(target) as temporary:
                    shutil.copyfile(source, temporary)

    def write(self, base: str, text: str) -> None:
        """Replace the edits: the text of `scene.toml` without and with them.

        Raises
        ------
        FormatError
            The file cannot be written; the edits before are still there.
        """
        with replacing(self.folder / EDITS) as temporary:
            temporary.write_text(_Texts(format=1, base=base, text=text).model_dump_json(), "utf-8")

    def forget(self) -> None:
        """Delete the edits; files of new objects stay until `close`."""
        with suppress(OSError):
            (self.folder / EDITS).unlink()

    def close(self) -> None:
        """Release the folder, and delete it unless it has edits."""
        if not (self.folder / EDITS).exists():
            shutil.rmtree(self.folder, ignore_errors=True)
        self._lock.close()
        with suppress(OSError):  # others are there
            self.folder.parent.rmdir()


@dataclass(frozen=True)
class Found:
    """Edits that a viewer left.

    Attributes
    ----------
    before, after : Manifest
        The scene without and with them.
    time_s : float
        Time of their autosave, as of `time.time`.
    """

    before: Manifest
    after: Manifest
    time_s: float

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the edits in a folder.

        Raises
        ------
        FormatError
            They cannot be read, in one line.
        """
        path = folder / EDITS
        if path.is_symlink():
            raise FormatError(f"{path}: is a link")
        data = read_bytes(path, MOST_BYTES)
        try:
            texts = _Texts.model_validate_json(data)
            before, after = (parse_manifest(text, EDITS) for text in (texts.base, texts.text))
            return cls(before, after, _time(folder))
        except ValidationError as error:
            raise FormatError(f"{path}: is damaged: {error.errors()[0]['type']}") from None
        except SceneError as error:
            raise FormatError(f"{path}: is damaged: {printable(error.lines[-1])}") from None


def left(root: Path) -> list[Path]:
    """Return the folders with edits of viewers that have ended, newest first; rubbish is deleted.

    Parameters
    ----------
    root : Path
        The scene's folder.
    """
    try:
        folders = [folder for folder in (root / AUTOSAVE_NAME).iterdir() if folder.is_dir()]
    except OSError:
        return []
    ended = []
    for folder in sorted(folders, key=_time, reverse=True)[:MOST_FOLDERS]:
        with suppress(FormatError):  # its viewer lives, or it is read-only or a link
            autosave = Autosave(folder)
            if (folder / EDITS).exists():
                ended.append(folder)
            autosave.close()
    return ended


def _time(folder: Path) -> float:
    try:
        return (folder / EDITS).lstat().st_mtime
    except OSError:
        return 0.0
