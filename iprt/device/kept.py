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
from collections.abc import Callable, Iterable, Iterator, Mapping
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

Arrays = Mapping[str, NDArray[Any]]

MOST_BYTES = 2**30
"""Most bytes of all entries."""
WORTH_KEEPING = 2**20
"""Texels of a panorama from which reading a result is faster than making it."""
HEADER, ALIGNMENT = 4096, 64
"""Bytes of a file before its arrays, and what the places of these are multiples of."""

_PACKAGE = Path(__file__).resolve().parents[1]
_IMPORT = re.compile(
    r"^[ \t]*(?:from|import)[ ]+(iprt[\w.]*)(?:[ ]+import[ ]+(\([^)]*\)|[^\n]*))?", re.MULTILINE
)
_PLAIN = (str, bytes, bool, int, float, np.generic)
_DIGEST = hashlib.sha256().digest_size


def kept(kind: str, code: str, inputs: Iterable[object], make: Callable[[], Arrays]) -> Arrays:
    """Return the result of `make` for these inputs, from the disk if possible.

    A damaged entry is made again. A folder that cannot be written is not an error.

    Parameters
    ----------
    kind : str
        Kind of result, a part of the file's name.
    code : str
        Module whose text, with the modules that it imports, decides what `make` returns.
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
    digest = hashlib.sha256(code_digest(code))
    _feed(digest, list(inputs))
    file = own_folder() / "results" / f"{kind}-{digest.hexdigest()}"
    found = _read(file)
    if found is None:
        found = make()
        _write(file, found)
    return found


@cache
def code_digest(module: str) -> bytes:
    """Return the hash of `code_texts`, and of the versions of NumPy and SciPy."""
    digest = hashlib.sha256(f"{version('numpy')} {version('scipy')}".encode())
    for name, text in sorted(code_texts(module).items()):
        _feed(digest, (name, text))
    return digest.digest()


def code_texts(module: str) -> dict[str, str]:
    """Return the text of a module of iprt, and of all of iprt that it imports, by name.

    The package's own file is left out: it only passes on names that its users ask for.
    """
    texts: dict[str, str] = {}
    left = [module]
    while left:
        name = left.pop()
        file = _file(name)
        if file is not None and name not in texts:
            texts[name] = file.read_text("utf-8")
            left += [*_imported(texts[name]), name.rpartition(".")[0]]
    return texts


def folder_digest(*folders: Path) -> bytes:
    """Return the hash of the names and contents of all files in folders."""
    digest = hashlib.sha256()
    for folder in folders:
        for file in sorted(path for path in folder.rglob("*") if path.is_file()):
            _feed(digest, (file.relative_to(folder).as_posix(), file.read_bytes()))
    return digest.digest()


def _file(module: str) -> Path | None:
    """Return the file of a module below the package; None for any other name."""
    place = _PACKAGE.joinpath(*module.split(".")[1:])
    files = (place.with_suffix(".py"), place / "__init__.py")
    return next((file for file in files if place != _PACKAGE and file.is_file()), None)


def _imported(text: str) -> Iterator[str]:
    """Yield the modules that a module may import, anywhere in its text."""
    for module, names in _IMPORT.findall(text):
        yield module
        yield from (f"{module}.{name}" for name in re.findall(r"\w+", names))


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
    """Read an entry; None if there is none, or if a byte of it differs from what was written."""
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
