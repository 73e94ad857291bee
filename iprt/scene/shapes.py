"""Simple meshes that need no file, such as lamps are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np


def _sphere() -> Any:
    import trimesh

    return trimesh.creation.icosphere(subdivisions=4, radius=0.5)


def _cube() -> Any:
    import trimesh

    return trimesh.creation.box()


def _cylinder() -> Any:
    import trimesh

    upright = np.eye(4)[[0, 2, 1, 3]] * [[1], [1], [-1], [1]]
    return trimesh.creation.cylinder(0.5, 1.0, sections=64, transform=upright)


def _square() -> Any:
    """Return a square that lies and faces up."""
    import trimesh

    corners = [[x, 0.0, z] for x, z in ((-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5))]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


SHAPES: Mapping[str, Callable[[], Any]] = {
    "sphere": _sphere,
    "cube": _cube,
    "cylinder": _cylinder,
    "square": _square,
}
"""Makers of meshes, 1 m along each side, y up."""


@contextmanager
def mesh_file(mesh: Path) -> Iterator[Path]:
    """Yield a mesh file. The name of a shape that no file has stands for a temporary PLY file."""
    shape = None if mesh.exists() else SHAPES.get(str(mesh))
    if shape is None:
        yield mesh
        return
    with TemporaryDirectory() as folder:
        path = Path(folder, f"{mesh}.ply")
        shape().export(path)
        yield path
