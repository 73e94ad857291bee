"""Trees on disk equal new ones."""

from __future__ import annotations

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
    return tmp_path / "iprt" / "results"


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


def test_small_meshes_leave_no_files(folder: Path, builds: list[int]) -> None:
    cached_tree(*boxes(count=20))
    assert not folder.exists()
