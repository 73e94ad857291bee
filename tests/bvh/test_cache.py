"""Trees on disk: read when they fit, ignored when anything is wrong with them."""

from __future__ import annotations

import os
import pickle
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.bvh import cache
from iprt.bvh.build import mesh_tree
from iprt.bvh.cache import cached_tree
from iprt.bvh.tree import Tree

COUNT = 100


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(cache, "WORTH_KEEPING", 50)
    return tmp_path / "iprt" / "bvh"


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry per tree that was built."""
    made: list[int] = []

    def counted(low: NDArray[np.float32], high: NDArray[np.float32]) -> Tree:
        made.append(len(low))
        return mesh_tree(low, high)

    monkeypatch.setattr(cache, "mesh_tree", counted)
    return made


def boxes(seed: int = 0, count: int = COUNT) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    low = np.random.default_rng(seed).random((count, 3)).astype(np.float32)
    return low, low + np.float32(0.1)


def same(a: Tree, b: Tree) -> bool:
    return all(np.array_equal(vars(a)[name], vars(b)[name]) for name in vars(a))


def test_a_tree_is_built_once(folder: Path, builds: list[int]) -> None:
    first = cached_tree(*boxes())
    assert same(cached_tree(*boxes()), first)
    assert builds == [COUNT]
    cached_tree(*boxes(seed=1))
    assert builds == [COUNT, COUNT]
    assert len(list(folder.iterdir())) == 2


def test_a_new_builder_reads_no_old_trees(
    folder: Path, builds: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    cached_tree(*boxes())
    monkeypatch.setattr(cache, "VERSION", cache.VERSION + 1)
    cached_tree(*boxes())
    assert len(builds) == 2


def test_small_meshes_leave_no_files(folder: Path, builds: list[int]) -> None:
    cached_tree(*boxes(count=20))
    assert not folder.exists()


def spoil_nothing_left(tree: dict[str, NDArray[np.int32]]) -> None:
    tree.clear()


def spoil_order(tree: dict[str, NDArray[np.int32]]) -> None:
    tree["order"][0] = tree["order"][1]


def spoil_reference(tree: dict[str, NDArray[np.int32]]) -> None:
    tree["children"][-1, 0] = 10**6


def spoil_loop(tree: dict[str, NDArray[np.int32]]) -> None:
    """Every node has a parent, but some are each other's."""
    children, levels = tree["children"], tree["levels"]
    a, b = (children >= 0)[levels[1] :].nonzero()
    row, side = a[-1] + levels[1], b[-1]
    below = children[row, side]
    up, at = (children == row).nonzero()
    children[up[0], at[0]], children[row, side] = below, row


def spoil_leaf_sizes(tree: dict[str, NDArray[np.int32]]) -> None:
    tree["first"][1] -= 3


def spoil_levels(tree: dict[str, NDArray[np.int32]]) -> None:
    tree["levels"][1] += 1


def spoil_size(tree: dict[str, NDArray[np.int32]]) -> None:
    tree.update(vars(mesh_tree(*boxes(count=COUNT - 4))))


@pytest.mark.parametrize(
    "spoil",
    [
        spoil_nothing_left,
        spoil_order,
        spoil_reference,
        spoil_loop,
        spoil_leaf_sizes,
        spoil_levels,
        spoil_size,
    ],
)
def test_what_is_no_tree_is_built_anew(folder: Path, builds: list[int], spoil: object) -> None:
    good = cached_tree(*boxes())
    (file,) = folder.iterdir()
    arrays = {name: array.copy() for name, array in vars(good).items()}
    spoil(arrays)  # type: ignore[operator]
    file.write_bytes(b"".join(array.astype("<i4").tobytes() for array in arrays.values()))
    assert same(cached_tree(*boxes()), good)
    assert len(builds) == 2
    assert same(cached_tree(*boxes()), good)  # and kept again
    assert len(builds) == 2


@pytest.mark.parametrize("keep", [0, 10, 200, -20])
def test_a_file_that_is_cut_off_is_built_anew(folder: Path, builds: list[int], keep: int) -> None:
    good = cached_tree(*boxes())
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:keep])
    assert same(cached_tree(*boxes()), good)
    assert len(builds) == 2


def test_nothing_that_is_found_there_is_run(folder: Path, builds: list[int]) -> None:
    class Evil:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(folder / "made"),)

    good = cached_tree(*boxes())
    (file,) = folder.iterdir()
    for data in (pickle.dumps(Evil()), pickle.dumps(Evil()) * 100):
        file.write_bytes(data)
        assert same(cached_tree(*boxes()), good)
    assert len(builds) == 3
    assert not (folder / "made").exists()


def test_a_file_of_any_size_takes_no_memory(folder: Path, builds: list[int]) -> None:
    good = cached_tree(*boxes())
    (file,) = folder.iterdir()
    with file.open("wb") as stream:
        stream.truncate(2**40)  # without a single block on the disk
    tracemalloc.start()
    try:
        assert same(cached_tree(*boxes()), good)
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()
    assert len(builds) == 2


def test_what_is_no_file_is_not_waited_for(folder: Path, builds: list[int]) -> None:
    good = cached_tree(*boxes())
    (file,) = folder.iterdir()
    file.unlink()
    os.mkfifo(file)
    assert same(cached_tree(*boxes()), good)
    assert len(builds) == 2


def test_a_folder_that_cannot_be_written_is_no_error(
    tmp_path: Path, builds: list[int], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    for _ in range(2):
        cached_tree(*boxes())
    assert len(builds) == 2
