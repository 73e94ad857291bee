"""Tangents: analytic surfaces, mirrored coordinates, transforms, and files."""

from __future__ import annotations

import base64
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt.geometry.meshes import load_mesh
from iprt.geometry.tangents import moved_tangents, with_tangents
from tests.geometry.gltf_files import GltfFile

Float = NDArray[np.float64]
SQUARE = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
UP = np.tile([0.0, 0, 1], (4, 1))


def bitangents(normals: Float, tangents: Float) -> Float:
    return tangents[:, 3:] * np.cross(normals, tangents[:, :3])


def test_a_square_has_the_axes_of_its_coordinates() -> None:
    uvs = SQUARE[:, :2] @ np.array([[0.6, 0.8], [-0.8, 0.6]]).T
    source, tangents, triangles = with_tangents(SQUARE, UP, uvs, HALVES)
    np.testing.assert_array_equal(source, range(4))
    np.testing.assert_array_equal(triangles, HALVES)
    np.testing.assert_allclose(tangents, np.tile([0.6, 0.8, 0, 1], (4, 1)), atol=1e-12)
    np.testing.assert_allclose(
        bitangents(UP, tangents), np.tile([-0.8, 0.6, 0], (4, 1)), atol=1e-12
    )


def test_vertices_are_split_where_coordinates_are_mirrored() -> None:
    """Two squares share an edge, from which u grows to both sides."""
    positions = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0], [-1, 1, 0], [0, 1, 0], [1, 1, 0]])
    uvs = np.stack([np.abs(positions[:, 0]), positions[:, 1]], axis=1)
    triangles = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    normals = np.tile([0.0, 0, 1], (6, 1))
    source, tangents, split = with_tangents(positions, normals, uvs, triangles)
    assert sorted(source) == [0, 1, 1, 2, 3, 4, 4, 5]
    np.testing.assert_array_equal(source[split], triangles)
    for faces, sign in ((split[:2], -1.0), (split[2:], 1.0)):
        np.testing.assert_allclose(tangents[np.unique(faces)], [[sign, 0, 0, sign]] * 4, atol=1e-12)
    along_v = bitangents(normals[source], tangents)
    np.testing.assert_allclose(along_v, np.tile([0.0, 1, 0], (8, 1)), atol=1e-12)


def test_a_cylinder_is_smooth() -> None:
    """Tangents at shared vertices follow the round surface, not the faces."""
    angle, height = np.meshgrid(np.linspace(0, np.pi, 13), [0.0, 1.0])
    positions = np.stack([np.cos(angle), height, np.sin(angle)], -1).reshape(-1, 3)
    normals = positions * [1.0, 0.0, 1.0]
    uvs = np.stack([angle / np.pi, height], -1).reshape(-1, 2)
    first = np.arange(12)
    triangles = np.concatenate(
        [
            np.stack([first, first + 14, first + 1], -1),
            np.stack([first, first + 13, first + 14], -1),
        ]
    )
    source, tangents, _ = with_tangents(positions, normals, uvs, triangles)
    expected = np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], -1).reshape(-1, 3)[source]
    np.testing.assert_allclose(tangents[:, :3], expected, atol=1e-9)


def test_transforms_keep_u_and_v() -> None:
    uvs = SQUARE[:, :2]
    _, tangents, _ = with_tangents(SQUARE, UP, uvs, HALVES)
    matrix = np.array([[[0.0, -3, 0, 5], [-1, 0, 0, 2], [0, 0, 2, 1]]])
    moved = moved_tangents(tangents, matrix)
    linear = matrix[0, :, :3]
    normals = np.tile([0.0, 0, 1], (4, 1))
    np.testing.assert_allclose(moved[:, :3], np.tile(linear @ [1, 0, 0], (4, 1)), atol=1e-12)
    along_v = linear @ [0, 1, 0] / 3.0
    np.testing.assert_allclose(bitangents(normals, moved), np.tile(along_v, (4, 1)), atol=1e-12)


def test_coordinates_without_an_area_have_none() -> None:
    _, tangents, _ = with_tangents(SQUARE, UP, np.zeros((4, 2)), HALVES)
    np.testing.assert_array_equal(tangents, np.tile([0.0, 0, 0, 1], (4, 1)))


@pytest.mark.parametrize("given", [False, True])
def test_tangents_of_a_file(tmp_path: Path, given: bool) -> None:
    """A node turns the square by a quarter about z; v points down in the file."""
    file = GltfFile()
    attributes: dict[str, Any] = {
        "NORMAL": file.array(UP),
        "TEXCOORD_0": file.array(SQUARE[:, :2] * [1, -1] + [0, 1]),
    }
    if given:
        attributes["TANGENT"] = file.array(np.tile([0.0, 1, 0, -1], (4, 1)))
    number = file.mesh(SQUARE, HALVES, **attributes)
    file.document["meshes"][number]["primitives"][0]["material"] = 0
    file.document["materials"] = [{"normalTexture": {"index": 0, "scale": 0.5}}]
    file.document["textures"] = [{"source": 0}]
    with BytesIO() as stream:
        Image.new("RGB", (1, 1), (128, 255, 128)).save(stream, "PNG")
        pixel = base64.b64encode(stream.getvalue()).decode()
    file.document["images"] = [{"uri": f"data:image/png;base64,{pixel}"}]
    file.node(mesh=number, rotation=[0, 0, np.sqrt(0.5), np.sqrt(0.5)])
    mesh = load_mesh(file.write(tmp_path / "q.glb"))
    assert mesh.tangents is not None
    expected = [-1, 0, 0, -1] if given else [0, 1, 0, 1]
    np.testing.assert_allclose(mesh.tangents, np.tile(expected, (4, 1)), atol=1e-6)
    assert mesh.materials[0].normal_texture is not None
    assert mesh.dropped == ()


def test_only_materials_with_a_normal_map_have_tangents(tmp_path: Path) -> None:
    file = GltfFile()
    file.node(mesh=file.mesh(SQUARE, HALVES))
    assert load_mesh(file.write(tmp_path / "q.glb")).tangents is None
