"""USD files, read by a process of their own (`usd_child.py`)."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.message_text import printable
from iprt.files.safe_reading import stays_inside
from iprt.files.termination import at_termination
from iprt.geometry.usd_data import USD_SUFFIXES, UsdContents

MAX_ENTRIES = 2**14
"""Limit for the files of a package."""
_MAGIC = {".usda": b"#usda ", ".usdc": b"PXR-USDC", ".usdz": b"PK\x03\x04"}
READING = [sys.executable, "-m", "iprt.geometry.usd_child"]


class UsdFile:
    """A USD file with its meshes and materials.

    Parameters
    ----------
    path : Path
        .usd, .usda, .usdc or .usdz.
    data : bytes
        Contents of the file.
    within : Path
        Folder that must hold all files, with links resolved.

    Attributes
    ----------
    contents : UsdContents
    arrays : dict of str to array
        As `iprt.geometry.usd_stage.placed_arrays` names them.

    Raises
    ------
    FormatError
        The file is damaged or too large, refers to layers that are missing or outside of the
        folder, or USD is not installed.
    """

    def __init__(self, path: Path, data: bytes, within: Path) -> None:
        kind = next((kind for kind, magic in _MAGIC.items() if data.startswith(magic)), None)
        if kind is None or path.suffix.lower() not in (kind, ".usd"):
            raise FormatError(f"{path}: cut off or damaged USD file (no header of USD)")
        require_usd(path)
        self._path = path
        self._package = ZipFile(BytesIO(data)) if kind == ".usdz" else None
        self.packed: frozenset[str] | None = None
        with _folder() as folder:
            root = Path(os.path.abspath(path))
            if self._package is not None:
                root, within = self._unpacked(folder, len(data)), folder
            self.contents, self.arrays = self._read(root, within, folder / "arrays.npz")

    def texture(self, name: str) -> bytes:
        """Return the contents of a file of the package."""
        assert self._package is not None
        return self._package.read(name)

    def _unpacked(self, folder: Path, size: int) -> Path:
        """Write the layers of a package to a folder, and return the first, which is its root."""
        assert self._package is not None
        entries = [entry for entry in self._package.infolist() if not entry.is_dir()]
        for entry in entries:
            name = entry.filename
            if entry.compress_type != ZIP_STORED or not stays_inside(name) or ":" in name:
                raise ValueError(f"{printable(name)} is compressed, or has no plain name")
        if len(entries) > MAX_ENTRIES or sum(entry.file_size for entry in entries) > size:
            raise ValueError("its files are larger than itself")
        for entry in entries:
            name = entry.filename
            if Path(name).suffix.lower() in USD_SUFFIXES[:-1]:
                target = folder / name
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(self._package.read(entry))
        first = folder / entries[0].filename if entries else folder
        if not first.is_file():
            raise ValueError("its first file is no USD layer")
        self.packed = frozenset(entry.filename for entry in entries)
        return first

    def _read(
        self, root: Path, within: Path, target: Path
    ) -> tuple[UsdContents, dict[str, NDArray[Any]]]:
        request = {"root": root, "within": within, "shown": self._path, "arrays": target}
        result = subprocess.run(
            READING,
            input=json.dumps({key: str(value) for key, value in request.items()}),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="utf-8",
            check=False,
        )
        if result.returncode != 0:
            raise ValueError("USD ran out of memory or time, or failed, while reading it")
        contents = UsdContents.model_validate_json(result.stdout)
        if contents.error is not None:
            raise FormatError(contents.error)
        with np.load(target, allow_pickle=False) as stored:
            return contents, dict(stored)


def require_usd(path: Path) -> None:
    """Raise FormatError, which names the file, unless USD is installed."""
    if importlib.util.find_spec("pxr") is None:
        raise FormatError(f"{path}: USD needs the package usd-core: pip install 'iprt[usd]'")


@contextmanager
def _folder() -> Iterator[Path]:
    """Yield a new folder, which is removed afterwards, also if a signal ends the process."""
    folder = Path(os.path.realpath(tempfile.mkdtemp(prefix="iprt-usd-")))

    def remove() -> None:
        shutil.rmtree(folder, ignore_errors=True)

    with at_termination(remove):
        try:
            yield folder
        finally:
            remove()
