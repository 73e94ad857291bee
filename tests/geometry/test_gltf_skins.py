"""Skins at rest: where joints place vertices, by the formula of glTF 2.0, section 3.7.3.3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.errors import FormatError
from iprt.geometry import gltf_skin
from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_files import GltfFile, face_normals

CORNERS = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1.8, 0], [-0.5, 1.8, 0]])
TRIANGLES = [[0, 1, 2], [0, 2, 3]]
TURN = Rotation.from_euler("xyz", (20, -50, 110), degrees=True)


def placed(
    translation: tuple[float, ...] = (0, 0, 0), turn: Rotation | None = None, scale: float = 1.0
) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3] = scale * (np.eye(3) if turn is None else turn.as_matrix())
    matrix[:3, 3] = translation
    return matrix


def column_by_column(matrix: NDArray[np.float64]) -> list[float]:
    return [float(value) for value in matrix.T.ravel()]


def skinned(
    upper: NDArray[np.float64],
    armature: NDArray[np.float64],
    joints: list[NDArray[np.float64]],
    inverse: NDArray[np.float64],
    *,
    normals: bool = True,
) -> GltfFile:
    """A quad below an armature, as its joints are; `upper` is the weight of the second."""
    file = GltfFile()
    none = np.zeros(4)
    attributes = {
        "JOINTS_0": file.array(np.tile([0, 1, 0, 0], (4, 1)), "u1"),
        "WEIGHTS_0": file.array(np.stack([1.0 - upper, upper, none, none], axis=1)),
    }
    if normals:
        attributes["NORMAL"] = file.array(np.tile([0.0, 0.0, 1.0], (4, 1)))
    mesh = file.mesh(CORNERS, TRIANGLES, **attributes)
    skin = file.skin([1, 2], inverse)
    file.node(matrix=column_by_column(armature), children=[1, 3])
    file.node(matrix=column_by_column(joints[0]), children=[2])
    file.node(matrix=column_by_column(joints[1]))
    file.node(mesh=mesh, skin=skin, translation=[7, 7, 7])
    return file


def test_an_armature_in_centimetres_does_not_shrink_the_mesh(tmp_path: Path) -> None:
    """Inverse bind matrices undo it: a common export."""
    inverse = np.tile(placed(scale=100.0), (2, 1, 1))
    file = skinned(np.zeros(4), placed(scale=0.01), [np.eye(4)] * 2, inverse)
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(mesh.positions, CORNERS, atol=1e-6)
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1], (4, 1)), atol=1e-6)
    assert mesh.dropped == ()


@pytest.mark.parametrize("normals", [True, False])
def test_joints_and_inverse_bind_matrices_place_vertices(tmp_path: Path, normals: bool) -> None:
    upper = np.array([0.0, 0.25, 1.0, 0.5])
    armature = placed((1, 2, 3), Rotation.from_euler("y", 30, degrees=True), 0.5)
    joints = [placed((0, 0.5, 0), TURN), placed((0.2, 0, 1), TURN.inv(), 2.0)]
    inverse = np.stack([placed((0, -0.5, 0)), placed((0.1, -1.5, 0), TURN)])
    path = skinned(upper, armature, joints, inverse, normals=normals).write(tmp_path / "a.glb")
    mesh = load_mesh(path)
    first = armature @ joints[0]
    matrices = np.stack([first @ inverse[0], first @ joints[1] @ inverse[1]])
    blended = np.einsum("vj,jik->vik", np.stack([1 - upper, upper], axis=1), matrices)
    points = np.concatenate([CORNERS, np.ones((4, 1))], axis=1)
    expected = np.einsum("vik,vk->vi", blended, points)[:, :3]
    corners = mesh.positions[mesh.triangles]
    np.testing.assert_allclose(corners, expected[TRIANGLES], atol=1e-5)
    if normals:
        side = np.linalg.inv(blended[:, :3, :3])[:, 2]  # inverse transpose, times +Z
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        np.testing.assert_allclose(mesh.normals[mesh.triangles], side[TRIANGLES], atol=1e-5)
    else:
        flat = np.repeat(face_normals(mesh)[:, None], 3, axis=1)
        np.testing.assert_allclose(mesh.normals[mesh.triangles], flat, atol=1e-5)


def test_mirrored_joints_keep_the_outside_outside(tmp_path: Path) -> None:
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    inverse = np.tile(np.eye(4), (2, 1, 1))
    file = skinned(np.zeros(4), mirror, [np.eye(4)] * 2, inverse)
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1], (4, 1)), atol=1e-6)
    np.testing.assert_allclose(face_normals(mesh), np.tile([0, 0, 1], (2, 1)), atol=1e-6)


def test_a_mesh_without_weights_follows_its_node(tmp_path: Path) -> None:
    inverse = np.tile(np.eye(4), (2, 1, 1))
    file = skinned(np.zeros(4), placed((1, 0, 0)), [np.eye(4)] * 2, inverse)
    for name in ("JOINTS_0", "WEIGHTS_0"):
        del file.document["meshes"][0]["primitives"][0]["attributes"][name]
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(mesh.positions, np.add(CORNERS, [8, 7, 7]), atol=1e-5)


def test_many_vertices_are_not_bent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf_skin, "MAX_BENT_VERTICES", 3)
    file = skinned(np.zeros(4), np.eye(4), [np.eye(4)] * 2, np.tile(np.eye(4), (2, 1, 1)))
    with pytest.raises(FormatError, match="4 vertices that move; at most 3 are read"):
        load_mesh(file.write(tmp_path / "a.glb"))
