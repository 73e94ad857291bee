"""Disk cache for the trees of large meshes."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.build import MESH_DEPTH, PACKET, mesh_tree
from iprt.bvh.tree import Tree
from iprt.device.caches import own_folder
from iprt.errors import FormatError
from iprt.files.atomic import replacing

Floats = NDArray[np.float32]

VERSION = 1
"""Raise this when `build_tree` changes its results."""
WORTH_KEEPING = 20_000
"""Triangle count from which reading a tree is faster than building it."""


def cached_tree(low: Floats, high: Floats) -> Tree:
    """Return `mesh_tree` of these boxes, from the cache if possible.

    Cached trees are validated; a tree that does not fit the boxes is rebuilt. An unwritable cache
    folder is not an error.
    """
    if len(low) < WORTH_KEEPING:
        return mesh_tree(low, high)
    digest = hashlib.blake2b(f"{VERSION} {PACKET} {MESH_DEPTH}".encode(), digest_size=20)
    digest.update(low.tobytes())
    digest.update(high.tobytes())
    file = own_folder() / "bvh" / f"{digest.hexdigest()}.tree"
    tree = _read(file, len(low))
    if tree is None:
        tree = mesh_tree(low, high)
        _write(file, tree)
    return tree


def _read(file: Path, primitives: int) -> Tree | None:
    """Read a tree: the arrays of `Tree` in order, as little-endian int32; None if invalid.

    All sizes follow from the number of primitives. No size in the file is trusted, and no more than
    the size of a tree is read.
    """
    leaves = -(-primitives // PACKET)
    fixed = np.cumsum([primitives, leaves + 1, 2 * (leaves - 1)])
    most = fixed[-1] + MESH_DEPTH + 1
    try:
        if not file.is_file():
            return None
        stored = np.fromfile(file, "<i4", count=most + 1).astype(np.int32)
    except (OSError, MemoryError):
        return None
    if not fixed[-1] < len(stored) <= most:
        return None
    order, first, children, levels = np.split(stored, fixed)
    tree = Tree(order, first, children.reshape(-1, 2), levels)
    return tree if is_tree(tree, primitives) else None


def _write(file: Path, tree: Tree) -> None:
    arrays = (tree.order, tree.first, tree.children.ravel(), tree.levels)
    with suppress(FormatError), replacing(file) as temporary:
        np.concatenate(arrays).astype("<i4").tofile(temporary)


def is_tree(tree: Tree, primitives: int) -> bool:
    """Return True if this is a tree over `primitives` that kernels can traverse."""
    arrays = (tree.order, tree.first, tree.children.ravel(), tree.levels)
    if any(array.dtype != np.int32 or array.ndim != 1 for array in arrays):
        return False
    leaves = -(-primitives // PACKET)
    if len(tree.first) != leaves + 1 or tree.children.shape != (leaves - 1, 2):
        return False
    count = np.diff(tree.first)
    if tree.first[0] != 0 or tree.first[-1] != primitives or not 1 <= count.min() <= PACKET:
        return False
    depth = len(tree.levels) - 1
    if not 0 <= depth <= MESH_DEPTH or tree.levels[0] != 0 or tree.levels[-1] != leaves - 1:
        return False
    if count.max() > PACKET or (np.diff(tree.levels) < 1).any():
        return False
    if not np.array_equal(np.sort(tree.order), np.arange(primitives)):
        return False
    # Every node but the root, and every leaf, is a child of exactly one node in the level above.
    references = np.concatenate([np.arange(-leaves, 0), np.arange(1, leaves - 1)])
    if leaves > 1 and not np.array_equal(np.sort(tree.children.ravel()), references):
        return False
    level = np.repeat(np.arange(depth), np.diff(tree.levels))
    parent, side = np.nonzero(tree.children >= 0)
    return bool((level[tree.children[parent, side]] == level[parent] + 1).all())
