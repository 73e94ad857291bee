"""Results on disk: found by all that they depend on, made again when they are damaged."""

from __future__ import annotations

import os
import pickle
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device import kept as module
from iprt.device.kept import Arrays, kept

CODE = "iprt.device.kept"


@dataclass(frozen=True)
class Input:
    """An input of each kind that results depend on."""

    values: NDArray[np.float32]
    name: str = "a"
    size: float = 0.1
    pair: tuple[int, ...] = (1, 2)
    table: NDArray[np.bool_] | None = None


INPUT = Input(np.arange(12, dtype=np.float32).reshape(3, 4))
OTHERS = {
    "value": replace(INPUT, values=INPUT.values + np.float32(1e-6)),
    "sign of zero": replace(INPUT, values=INPUT.values * np.where(INPUT.values > 0, 1, -1)),
    "shape": replace(INPUT, values=INPUT.values.reshape(4, 3)),
    "order": replace(INPUT, values=np.asfortranarray(INPUT.values.T)),
    "type": replace(INPUT, values=INPUT.values.view(np.int32)),
    "text": replace(INPUT, name="b"),
    "number": replace(INPUT, size=float(np.nextafter(0.1, 1.0))),
    "length": replace(INPUT, pair=(1, 2, 0)),
    "split": replace(INPUT, pair=(12,)),
    "absent": replace(INPUT, table=np.zeros(0, bool)),
}


class Made:
    """A maker that counts its results, of several types and shapes, some of them empty."""

    def __init__(self, seed: int = 0) -> None:
        self.count = 0
        rng = np.random.default_rng(seed)
        self.arrays: dict[str, NDArray[Any]] = {
            "picture": rng.random((5, 7, 3), np.float32),
            "numbers": rng.integers(0, 9, 11),
            "none": np.zeros((0, 3), np.int32),
            "flag": np.array(True),
            "sliced": rng.random((6, 6))[::2, 1:],
        }

    def __call__(self) -> Arrays:
        self.count += 1
        return self.arrays


@pytest.fixture
def made() -> Made:
    return Made()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "iprt" / "results"


def require_same(found: Arrays, arrays: Arrays) -> None:
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        assert found[name].shape == array.shape
        assert found[name].tobytes() == array.tobytes()


def test_it_is_made_once(folder: Path, made: Made) -> None:
    for _ in range(2):
        require_same(kept("kind", CODE, [INPUT, 3], made), made.arrays)
    assert made.count == 1
    kept("other", CODE, [INPUT, 3], made)
    assert made.count == 2
    assert len(list(folder.iterdir())) == 2


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS.keys())
def test_it_is_made_again_for_other_inputs(folder: Path, made: Made, other: Input) -> None:
    kept("kind", CODE, [INPUT], made)
    kept("kind", CODE, [other], made)
    assert made.count == 2
    kept("kind", CODE, [replace(INPUT, values=INPUT.values.copy())], made)
    assert made.count == 2


def test_inputs_whose_content_is_unknown_are_refused(folder: Path, made: Made) -> None:
    with pytest.raises(TypeError, match="object"):
        kept("kind", CODE, [object()], made)
    assert not made.count


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package `iprt`, in which `iprt.a` imports others in each way that Python has."""
    package = tmp_path / "package" / "iprt"
    texts = {
        "iprt/__init__.py": "",
        "iprt/a.py": "from iprt.b import (\n    one,\n    two,\n)\nimport numpy\n",
        "iprt/b.py": "def f():\n    from iprt import c\n",
        "iprt/c.py": "import iprt.d as d\nfrom iprt.sub.e import x\n",
        "iprt/d.py": "from iprt.a import f\n",
        "iprt/sub/__init__.py": "",
        "iprt/sub/e.py": "",
        "iprt/apart.py": "from iprt.a import f\n",
        "cl/f.cl": "",
        "cl/lib/g.h": "",
    }
    for name, text in texts.items():
        file = package.parent / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        os.utime(file, (0, 0))
    monkeypatch.setattr(module, "_PACKAGE", package)
    monkeypatch.setattr(module, "CL", package.parent / "cl")
    for cached in ("code_digest", "_file_digest", "_kernel_files", "_versions"):
        monkeypatch.setattr(module, cached, getattr(module, cached).__wrapped__)
    module._file.cache_clear()
    yield package.parent
    module._file.cache_clear()


DECIDES = ("iprt/a.py", "iprt/b.py", "iprt/c.py", "iprt/d.py", "iprt/sub/__init__.py")


@pytest.mark.parametrize(
    ("name", "decides"),
    [
        *[(name, True) for name in (*DECIDES, "iprt/sub/e.py", "cl/f.cl", "cl/lib/g.h")],
        *[(name, False) for name in ("iprt/__init__.py", "iprt/apart.py")],
    ],
)
def test_it_is_made_again_by_other_code(
    package: Path, folder: Path, made: Made, name: str, decides: bool
) -> None:
    kept("kind", "iprt.a", [INPUT], made)
    with (package / name).open("a") as stream:
        stream.write("VALUE = 1\n")
    os.utime(package / name, (0, 0))
    for _ in range(2):
        kept("kind", "iprt.a", [INPUT], made)
    assert made.count == (2 if decides else 1)


def test_it_is_made_again_with_another_library(
    package: Path, folder: Path, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept("kind", "iprt.a", [INPUT], made)
    monkeypatch.setattr(module, "version", lambda name: f"{name} 99")
    kept("kind", "iprt.a", [INPUT], made)
    assert made.count == 2


def test_a_process_older_than_its_code_keeps_nothing(
    package: Path, folder: Path, made: Made
) -> None:
    (package / "iprt/b.py").touch()
    for _ in range(2):
        kept("kind", "iprt.a", [INPUT], made)
    assert made.count == 2
    assert not folder.exists()


def test_modules_that_pass_values_on_are_followed() -> None:
    """The code that prepares depth depends on the geometry of panoramas, two imports below."""
    files = module.code_files("iprt.footage.prepare.stages")
    assert {"iprt.footage.prepare.fill", "iprt.geometry.equirect", "iprt.footage"} < set(files)
    assert "iprt.renderer" not in files


@pytest.mark.parametrize("byte", [0, 31, 32, 60, 4100, -1])
def test_a_damaged_entry_is_made_again(folder: Path, made: Made, byte: int) -> None:
    kept("kind", CODE, [INPUT], made)
    (file,) = folder.iterdir()
    stored = bytearray(file.read_bytes())
    stored[byte] ^= 1
    file.write_bytes(stored)
    for _ in range(2):
        require_same(kept("kind", CODE, [INPUT], made), made.arrays)
    assert made.count == 2


@pytest.mark.parametrize("keep", [0, 10, 200, 4096, -20])
def test_an_entry_that_is_cut_off_is_made_again(folder: Path, made: Made, keep: int) -> None:
    kept("kind", CODE, [INPUT], made)
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:keep])
    require_same(kept("kind", CODE, [INPUT], made), made.arrays)
    assert made.count == 2


def test_an_entry_under_the_name_of_another_is_not_believed(folder: Path, made: Made) -> None:
    kept("kind", CODE, [1], Made(seed=1))
    (file,) = folder.iterdir()
    kept("kind", CODE, [2], made)
    (other,) = set(folder.iterdir()) - {file}
    file.replace(other)
    require_same(kept("kind", CODE, [2], made), made.arrays)
    assert made.count == 2


def test_nothing_that_is_found_there_is_run(folder: Path, made: Made) -> None:
    class Evil:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(folder / "made"),)

    kept("kind", CODE, [INPUT], made)
    (file,) = folder.iterdir()
    file.write_bytes(pickle.dumps(Evil()))
    require_same(kept("kind", CODE, [INPUT], made), made.arrays)
    assert made.count == 2
    assert not (folder / "made").exists()


def test_a_file_of_any_size_takes_no_memory(folder: Path, made: Made) -> None:
    kept("kind", CODE, [INPUT], made)
    (file,) = folder.iterdir()
    with file.open("wb") as stream:
        stream.truncate(2**40)  # without a single block on the disk
    tracemalloc.start()
    try:
        require_same(kept("kind", CODE, [INPUT], made), made.arrays)
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()
    assert made.count == 2


def test_what_is_no_file_is_not_waited_for(folder: Path, made: Made) -> None:
    kept("kind", CODE, [INPUT], made)
    (file,) = folder.iterdir()
    file.unlink()
    os.mkfifo(file)
    require_same(kept("kind", CODE, [INPUT], made), made.arrays)
    assert made.count == 2


def test_a_folder_that_cannot_be_written_is_no_error(
    tmp_path: Path, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    for _ in range(2):
        require_same(kept("kind", CODE, [INPUT], made), made.arrays)
    assert made.count == 2


def test_the_least_recently_used_entries_make_room(
    folder: Path, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(3):
        kept("kind", CODE, [number], made)
        for file in folder.iterdir():  # a second passes
            status = file.stat()
            os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns - 10**9))
    size = file.stat().st_size
    kept("kind", CODE, [0], made)
    assert made.count == 3
    monkeypatch.setattr(module, "MOST_BYTES", 3 * size + 1)
    kept("kind", CODE, [3], made)
    assert made.count == 4
    assert sum(file.stat().st_size for file in folder.iterdir()) == 3 * size
    for number in (0, 2, 3):
        kept("kind", CODE, [number], made)
    assert made.count == 4
    kept("kind", CODE, [1], made)
    assert made.count == 5


def test_a_result_too_large_for_the_folder_is_not_written(
    folder: Path, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept("kind", CODE, [0], made)
    monkeypatch.setattr(module, "MOST_BYTES", 4400)
    require_same(kept("kind", CODE, [1], made), made.arrays)
    assert len(list(folder.iterdir())) == 1
