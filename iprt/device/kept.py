"""Results that are kept on disk, beside the compiled kernels.

A result is found under a hash of all that it depends on: its inputs, by content, and the text of
the code that makes it. Entries therefore never become stale. All together are bounded in size, and
the least recently used go first.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.device.caches import own_folder
from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.files.resources import CL

Arrays = Mapping[str, NDArray[Any]]

MOST_BYTES = 2**30
"""Most bytes of all entries."""
WORTH_KEEPING = 2**20
"""Texels of a panorama from which reading a result is faster than making it."""
STARTED = time.time()
"""Time at which this process began to import iprt, about."""
LIBRARIES = ("numpy", "scipy", "trimesh")
"""Packages that results depend on."""
HEADER, ALIGNMENT = 4096, 64
"""Bytes of a file before its arrays, and the alignment of their places."""

_PACKAGE = Path(__file__).resolve().parents[1]
_IMPORT = re.compile(
    r"^[ \t]*(?:from|import)[ ]+(iprt[\w.]*)(?:[ ]+import[ ]+(\([^)]*\)|[^\n]*))?", re.MULTILINE
)
_PLAIN = (str, bytes, bool, int, float, np.generic)
_DIGEST = hashlib.sha256().digest_size


def kept(
    kind: str,
    code: str,
    inputs: Iterable[object],
    make: Callable[[], Arrays],
) -> Arrays:
    """Return the result of `make` for these inputs, from the disk if possible.

    A damaged entry is made again. A folder that cannot be written is not an error.

    Parameters
    ----------
    kind : str
        Kind of result, a part of the file's name.
    code : str
        Module whose text, with the modules that it imports and `cl/`, decides what `make`
        returns.
    inputs : iterable
        All else that decides it: arrays, text, numbers, None, and sequences, mappings and
        dataclasses of these.
    make : callable
        Returns arrays by name.

    Returns
    -------
    mapping of str to array
        The same bits, whether read or made.

    Raises
    ------
    TypeError
        The content of an input is unknown.
    """
    key = code_digest(code)
    if key is None:
        return make()
    digest = hashlib.sha256(key)
    _feed(digest, list(inputs))
    file = own_folder() / "results" / f"{kind}-{digest.hexdigest()}"
    found = _read(file)
    if found is None:
        found = make()
        _write(file, found)
    return found


@cache
def code_digest(module: str) -> bytes | None:
    """Return the hash of the files of `code_files`, of `cl/`, and of the versions of `LIBRARIES`.

    None if a file is newer than this process, which may run an older one.
    """
    # Modules take constants from cl/.
    parts = [_file_digest(file) for _, file in sorted(code_files(module).items())]
    parts += [_file_digest(file) for file in _kernel_files()]
    digest = hashlib.sha256(_versions())
    for part in parts:
        if part is None:
            return None
        digest.update(part)
    return digest.digest()


@cache
def _file_digest(file: Path) -> bytes | None:
    """Return the hash of a file's content; None if it is newer than this process."""
    if file.stat().st_mtime > STARTED:
        return None
    return hashlib.sha256(file.read_bytes()).digest()


@cache
def _kernel_files() -> list[Path]:
    """Return the files of `cl/`, in order."""
    return sorted(file for file in CL.rglob("*") if file.is_file())


@cache
def _versions() -> bytes:
    return " ".join(map(version, LIBRARIES)).encode()


def code_files(module: str) -> dict[str, Path]:
    """Return the files of a module of iprt, and of all of iprt that it imports, by module.

    The package's own file is left out: it only passes on names that its users ask for.
    """
    files: dict[str, Path] = {}
    left, seen = [module], {module, ""}
    while left:
        name = left.pop()
        file = _file(name)
        if file is not None:
            files[name] = file
            new = _imported(file).union([name.rpartition(".")[0]]) - seen
            seen |= new
            left.extend(new)
    return files


@cache
def _file(module: str) -> Path | None:
    """Return the file of a module below the package; None for any other name."""
    _, *below = module.split(".")
    place = os.path.join(_PACKAGE, *below)
    files = (f"{place}.py", os.path.join(place, "__init__.py"))
    return next((Path(file) for file in files if below and os.path.isfile(file)), None)


@cache
def _imported(file: Path) -> frozenset[str]:
    """Return the modules that a module may import, anywhere in its text."""
    found = set()
    for module, names in _IMPORT.findall(file.read_text("utf-8")):
        found.add(module)
        found.update(f"{module}.{name}" for name in re.findall(r"\w+", names))
    return frozenset(found)


def _feed(digest: Any, value: object) -> None:
    """Add a value to a hash, such that different values give different bytes."""
    if isinstance(value, np.ndarray):
        digest.update(f"array {value.dtype.str} {value.shape};".encode())
        digest.update(_bytes(value))
    elif value is None or isinstance(value, _PLAIN):
        digest.update(f"{type(value).__name__} {value!r};".encode())
    elif is_dataclass(value):
        _feed(digest, [type(value).__name__, *(getattr(value, at.name) for at in fields(value))])
    elif isinstance(value, Mapping):
        _feed(digest, list(value.items()))
    elif isinstance(value, tuple | list):
        digest.update(f"sequence {len(value)};".encode())
        for item in value:
            _feed(digest, item)
    else:
        raise TypeError(f"a result that depends on {type(value).__name__} cannot be kept")


def _read(file: Path) -> Arrays | None:
    """Read an entry; None if there is none, or if it is damaged."""
    try:
        if not file.is_file() or file.stat().st_size > MOST_BYTES:
            return None
        stored = np.fromfile(file, np.uint8)
        os.utime(file)
    except (OSError, MemoryError):
        return None
    if bytes(stored[:_DIGEST]) != _checksum(file, [stored[_DIGEST:]]):
        return None
    found = {}
    for name, dtype, shape, start in json.loads(bytes(stored[_DIGEST:HEADER])):
        size = np.dtype(dtype).itemsize * math.prod(shape)
        found[name] = stored[start : start + size].view(dtype).reshape(shape)
    return found


def _write(file: Path, arrays: Arrays) -> None:
    """Write an entry: a checksum, the names and places of the arrays as JSON, and the arrays."""
    total, places, parts = HEADER, [], []
    for name, array in arrays.items():
        places.append((name, array.dtype.str, array.shape, total))
        padding = -array.nbytes % ALIGNMENT
        parts += [_bytes(array), np.zeros(padding, np.uint8)]
        total += array.nbytes + padding
    if total > MOST_BYTES:
        return
    header = json.dumps(places).encode().ljust(HEADER - _DIGEST)
    parts.insert(0, np.frombuffer(header, np.uint8))
    with suppress(FormatError), replacing(file) as temporary, temporary.open("wb") as stream:
        stream.write(_checksum(file, parts))
        for part in parts:
            part.tofile(stream)
    _make_room(file.parent)


def _checksum(file: Path, parts: Iterable[NDArray[np.uint8]]) -> bytes:
    """Return the hash of an entry and its name: an entry under another's name is damaged, too."""
    digest = hashlib.sha256(file.name.encode())
    for part in parts:
        digest.update(part.data)
    return digest.digest()


def _bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8)


def _make_room(folder: Path) -> None:
    """Remove entries, least recently used first, until all together fit."""
    with suppress(OSError):
        files = [(file.stat(), file) for file in folder.iterdir()]
        total = sum(status.st_size for status, _ in files)
        for status, file in sorted(files, key=lambda entry: entry[0].st_mtime_ns):
            if total <= MOST_BYTES:
                return
            file.unlink(missing_ok=True)
            total -= status.st_size
