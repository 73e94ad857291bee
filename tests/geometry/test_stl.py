"""STL files, binary and text: what they hold is read, and what they claim is checked first."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from iprt.errors import FormatError
from iprt.geometry.meshes import load_mesh
from iprt.geometry.stl_check import MAX_SOLIDS

FACET = """facet normal 0 0 0
 outer loop
  vertex 0 0 0
  vertex {x} 0 0
  vertex 0 1 0
 endloop
endfacet
"""


def solid(name: str = "", x: float | str = 1) -> str:
    return f"solid {name}\n{FACET.format(x=x)}endsolid {name}\n"


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_both_kinds_hold_the_same(kind: str, tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.export(tmp_path / "b.STL", file_type=kind)
    mesh = load_mesh(tmp_path / "b.STL")
    assert np.allclose(
        mesh.positions[mesh.triangles], ball.vertices[ball.faces].astype(np.float32), atol=1e-6
    )
    assert len(mesh.positions) == len(ball.vertices)
    assert mesh.dropped == ()


def test_a_binary_file_may_begin_as_a_text_does(tmp_path: Path) -> None:
    data = bytearray(trimesh.creation.box().export(file_type="stl"))
    data[:12] = b"solid of CAD"
    (tmp_path / "m.stl").write_bytes(data)
    assert len(load_mesh(tmp_path / "m.stl").triangles) == 12


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("name", ["", "my solid vertex 1", "facet", "endsolid solid"])
def test_names_that_are_words_of_the_format(name: str, end: str, tmp_path: Path) -> None:
    """The parser would take them for such, and lose what follows."""
    text = solid(name) + solid("other", x=2.5)
    (tmp_path / "m.stl").write_bytes(text.replace("\n", end).encode())
    mesh = load_mesh(tmp_path / "m.stl")
    assert len(mesh.triangles) == 2
    assert sorted(mesh.positions[mesh.triangles][:, 1, 0]) == [1.0, 2.5]


def test_colors_of_triangles_are_named(tmp_path: Path) -> None:
    data = bytearray(trimesh.creation.box().export(file_type="stl"))
    data[84 + 50 - 1] = 0x80
    (tmp_path / "m.stl").write_bytes(data)
    assert load_mesh(tmp_path / "m.stl").dropped == ("colors of triangles",)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_no_part_of_a_file_passes_for_the_whole(kind: str, tmp_path: Path) -> None:
    data = trimesh.creation.box().export(file_type=kind)
    data = data.encode() if isinstance(data, str) else data
    whole = len(data.rstrip())
    for length in [*range(0, 90, 7), *range(90, whole - 1, 61), whole - 1]:
        (tmp_path / "m.stl").write_bytes(data[:length])
        with pytest.raises(FormatError, match=r"m\.stl: cut off or damaged") as error:
            load_mesh(tmp_path / "m.stl")
        if kind == "stl" and length >= 84:
            assert f"{length} bytes; a header with 12 triangles would need {whole}" in str(
                error.value
            )


@pytest.mark.thorough
def test_limits_hold_before_anything_is_read(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_text(solid("a") * (MAX_SOLIDS + 1))
    with pytest.raises(FormatError, match=f"in {MAX_SOLIDS + 1} solids; at most"):
        load_mesh(tmp_path / "m.stl")
    count = 2**24 + 1
    with (tmp_path / "n.stl").open("wb") as file:  # a sparse file
        file.write(bytes(80) + struct.pack("<I", count))
        file.truncate(84 + 50 * count)
    with pytest.raises(FormatError, match=f"claims {count} triangles; at most {2**24} are read"):
        load_mesh(tmp_path / "n.stl")
