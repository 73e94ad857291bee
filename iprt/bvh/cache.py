"""Trees of large meshes, kept on disk between runs."""

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
"""To be raised when `build_tree` makes other trees."""
WORTH_KEEPING = 20_000
"""Triangles: smaller meshes are built as quickly as read."""


def cached_tree(low: Floats, high: Floats) -> Tree:
    """`mesh_tree` of these boxes, read from the cache where it holds it.

    What the cache holds is checked: a tree that is not one over these boxes is built anew. A folder
    that cannot be written is no error.
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
    """The tree in a file: the arrays of `Tree` one after the other, little-endian int32.

    All sizes follow from the number of primitives, so that nothing is believed that stands in the
    file, and no more is read than a tree has.
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
    """Whether this is a tree over so many primitives that kernels can walk through."""
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
    # Every node but the root, and every leaf, is a child once; nodes of the level above.
    references = np.concatenate([np.arange(-leaves, 0), np.arange(1, leaves - 1)])
    if leaves > 1 and not np.array_equal(np.sort(tree.children.ravel()), references):
        return False
    level = np.repeat(np.arange(depth), np.diff(tree.levels))
    parent, side = np.nonzero(tree.children >= 0)
    return bool((level[tree.children[parent, side]] == level[parent] + 1).all())
