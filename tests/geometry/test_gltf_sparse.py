"""Sparse accessors of glTF (section 3.6.2.3)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_files import GltfFile

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
MOVED = np.array([[3.0, 0.0, 0.0], [0.0, 4.0, 1.0]])


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
@pytest.mark.parametrize("base", [True, False], ids=["replaced", "of zeros"])
def test_elements_are_replaced(tmp_path: Path, base: bool, dtype: str) -> None:
    file = GltfFile()
    number = file.mesh(CORNERS, [[0, 1, 2], [0, 2, 3]])
    accessors = file.document["accessors"]
    positions = file.document["meshes"][number]["primitives"][0]["attributes"]["POSITION"]
    rows = np.array([1, 3]) if base else np.arange(4)
    values = MOVED if base else CORNERS
    indices, replacing = file.array(rows[:, None], dtype), file.array(values)
    accessors[positions]["sparse"] = {
        "count": len(rows),
        "indices": {
            "bufferView": accessors[indices]["bufferView"],
            "componentType": accessors[indices]["componentType"],
        },
        "values": {"bufferView": accessors[replacing]["bufferView"]},
    }
    if not base:
        del accessors[positions]["bufferView"]
    file.node(mesh=number)
    expected = CORNERS.copy()
    expected[rows] = values
    found = load_mesh(file.write(tmp_path / "s.glb"))
    np.testing.assert_array_equal(np.unique(found.positions, axis=0), np.unique(expected, axis=0))
