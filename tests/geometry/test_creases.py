"""Normals of meshes without any: flat in glTF, smooth up to a crease angle in other formats."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from iprt.geometry.animated_mesh import load_animated_mesh
from iprt.geometry.creases import CREASE_DEG, with_normals
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_files import GltfFile, bar, face_normals
from tests.scene.files import CUBE

Float = NDArray[np.float64]
CREASED = (".obj", ".ply", ".stl")


def exported(solid: trimesh.Trimesh, path: Path) -> Path:
    """Without normals: trimesh writes those that it has computed."""
    bare = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    options = {".stl": {}, ".ply": {"vertex_normal": False}}
    bare.export(path, **options.get(path.suffix, {"include_normals": False}))
    return path


def off_face_deg(mesh: Mesh) -> Float:
    """(F, 3) angles between the normals of corners and of their faces."""
    cosine = np.einsum("fci,fi->fc", mesh.normals[mesh.triangles], face_normals(mesh))
    angle: Float = np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return angle


@pytest.mark.parametrize("suffix", [*CREASED, ".glb", ".gltf"])
def test_boxes_are_sharp(suffix: str, tmp_path: Path) -> None:
    mesh = load_mesh(exported(trimesh.creation.box((1.0, 2.0, 3.0)), tmp_path / f"box{suffix}"))
    assert len(mesh.triangles) == 12
    assert off_face_deg(mesh).max() < 0.1


@pytest.mark.parametrize("suffix", CREASED)
@pytest.mark.parametrize(
    "solid",
    [trimesh.creation.icosphere(subdivisions=1), trimesh.creation.uv_sphere(count=[12, 16])],
    ids=["icosphere", "uv_sphere"],
)
def test_spheres_are_round(suffix: str, solid: trimesh.Trimesh, tmp_path: Path) -> None:
    mesh = load_mesh(exported(solid, tmp_path / f"ball{suffix}"))
    radial = mesh.positions / np.linalg.norm(mesh.positions, axis=1, keepdims=True)
    assert np.einsum("vi,vi->v", radial, mesh.normals).min() > np.cos(np.deg2rad(3.0))


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_gltf_without_normals_is_flat_even_where_it_is_round(suffix: str, tmp_path: Path) -> None:
    mesh = load_mesh(exported(trimesh.creation.icosphere(subdivisions=1), tmp_path / f"b{suffix}"))
    assert off_face_deg(mesh).max() < 0.1


def test_a_cylinder_is_round_and_its_rims_are_sharp(tmp_path: Path) -> None:
    solid = trimesh.creation.cylinder(radius=1.0, height=2.0, sections=24)
    mesh = load_mesh(exported(solid, tmp_path / "can.ply"))
    cap = np.abs(face_normals(mesh)[:, 2]) > 0.5
    assert off_face_deg(mesh)[cap].max() < 0.1
    side = mesh.triangles[~cap].ravel()
    radial = mesh.positions[side] * (1.0, 1.0, 0.0)
    assert np.allclose(mesh.normals[side], radial, atol=1e-3)


@pytest.mark.parametrize(("sides", "round_"), [(10, True), (8, False)])
def test_ten_sides_are_round_and_eight_are_not(sides: int, round_: bool, tmp_path: Path) -> None:
    solid = trimesh.creation.cylinder(radius=1.0, height=2.0, sections=sides)
    mesh = load_mesh(exported(solid, tmp_path / "can.ply"))
    side = np.abs(face_normals(mesh)[:, 2]) < 0.5
    off = off_face_deg(mesh)[side]
    assert off.max() == pytest.approx(180.0 / sides if round_ else 0.0, abs=0.1)


@pytest.mark.parametrize("angle", [CREASE_DEG - 1.0, CREASE_DEG + 1.0])
def test_the_crease_angle_is_where_edges_become_sharp(angle: float) -> None:
    tilt = np.deg2rad(angle)
    ridge = [[0, 0, 0], [0, 0, 1], [-1, 0, 0], [np.cos(tilt), -np.sin(tilt), 0]]
    triangles = np.array([[0, 2, 1], [0, 1, 3]])
    none = np.full((4, 3), np.nan)
    source, normals, divided = with_normals(
        np.array(ridge, float), none, triangles, np.zeros(2, bool)
    )
    assert np.array_equal(source[divided], triangles)
    sharp = angle > CREASE_DEG
    assert len(source) == (6 if sharp else 4)
    one, other = normals[divided[0, 0]], normals[divided[1, 0]]
    assert np.degrees(np.arccos(min(one @ other, 1.0))) == pytest.approx(
        angle if sharp else 0.0, abs=1e-4
    )


@pytest.mark.parametrize("suffix", CREASED)
def test_faces_that_cancel_each_other_out_have_a_normal(suffix: str, tmp_path: Path) -> None:
    """In a book that is open all the way round, the spine has the normal of one of the pages."""
    # Less than a crease lies between two of them.
    quarter = np.array([[24.0, 7.0], [20.0, 15.0], [15.0, 20.0], [7.0, 24.0]])
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    rim = np.concatenate([quarter @ np.linalg.matrix_power(turn.T, i) for i in range(4)])
    positions = np.concatenate([[[0, 0, 0], [0, 8, 0]], np.insert(rim, 1, 4.0, axis=1)])
    pages = [(0, 1, 2 + i) for i in range(len(rim))]
    book = trimesh.Trimesh(positions, pages, process=False)
    mesh = load_mesh(exported(book, tmp_path / f"book{suffix}"))
    spine = mesh.positions[:, 0] == 0.0
    assert spine.any()
    cosine = np.einsum("vi,fi->vf", mesh.normals[spine], face_normals(mesh))
    assert cosine.max(axis=1) == pytest.approx(1.0)


def test_smooth_normals_are_weighted_by_angles(tmp_path: Path) -> None:
    """How a quad is cut into triangles does not matter: by brute force, around every vertex."""
    solid = trimesh.creation.uv_sphere(count=[16, 16])
    mesh = load_mesh(exported(solid, tmp_path / "b.obj"))
    face = face_normals(mesh)
    for vertex in range(0, len(mesh.positions), 7):
        total = np.zeros(3)
        here = mesh.positions[vertex]
        for number, corners in enumerate(mesh.positions[mesh.triangles].astype(np.float64)):
            for at in range(3):
                if np.array_equal(corners[at], here):
                    a, b = corners[at - 2] - here, corners[at - 1] - here
                    cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
                    total += np.arccos(cosine) * face[number]
        assert np.allclose(mesh.normals[vertex], total / np.linalg.norm(total), atol=1e-5)


def test_borders_of_materials_are_smooth(tmp_path: Path) -> None:
    solid = trimesh.creation.icosphere(subdivisions=2)
    lines = [f"v {x} {y} {z}" for x, y, z in solid.vertices]
    for name, faces in zip("ab", np.array_split(solid.faces + 1, 2), strict=True):
        lines += [f"usemtl {name}", *(f"f {a} {b} {c}" for a, b, c in faces)]
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n")
    (tmp_path / "b.obj").write_text("\n".join(["mtllib m.mtl", *lines]))
    mesh = load_mesh(tmp_path / "b.obj")
    assert len(mesh.materials) == 2
    assert np.einsum("vi,vi->v", mesh.positions, mesh.normals).min() > 0.999


@pytest.mark.parametrize("order", ["one side after the other", "face by face"])
def test_faces_that_are_there_twice_stay_apart(order: str, tmp_path: Path) -> None:
    """A sphere of two sides: each is as smooth as without the other."""
    solid = trimesh.creation.icosphere(subdivisions=2)
    both = np.stack([solid.faces, solid.faces[:, ::-1]], axis=1 if order == "face by face" else 0)
    both = both.reshape(-1, 3)
    outer = (
        np.arange(len(both)) % 2 == 0
        if order == "face by face"
        else np.arange(len(both)) * 2 < len(both)
    )
    mesh = load_mesh(
        exported(trimesh.Trimesh(solid.vertices, both, process=False), tmp_path / "s.ply")
    )
    out = np.einsum("vi,vi->v", mesh.positions, mesh.normals)
    assert out[mesh.triangles[outer]].min() > 0.999
    assert out[mesh.triangles[~outer]].max() < -0.999


def test_a_fan_of_many_faces_takes_no_time_that_grows_with_its_square() -> None:
    """Around one vertex, 200,000 faces: pairs of them would be 4e10."""
    count = 200_000
    turn = 2 * np.pi * np.arange(count) / count
    rim = np.stack([np.cos(turn), np.zeros(count), -np.sin(turn)], axis=1)
    positions = np.concatenate([[[0.0, 1.0, 0.0]], rim])
    around = np.arange(count)
    triangles = np.stack([np.zeros(count, int), 1 + around, 1 + (around + 1) % count], axis=1)
    _, normals, _ = with_normals(
        positions, np.full_like(positions, np.nan), triangles, np.zeros(count, bool)
    )
    assert np.allclose(normals[0], [0, 1, 0], atol=1e-6)


def test_a_skin_without_normals_stays_flat_while_it_bends(tmp_path: Path) -> None:
    file = bar(smooth=True)
    smooth = load_animated_mesh(file.write(tmp_path / "given.glb"), 0)
    del file.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"]
    animated = load_animated_mesh(file.write(tmp_path / "bar.glb"), 0)
    for time_s in (0.0, 0.5, 0.99):
        mesh = animated.at(time_s)
        assert off_face_deg(mesh).max() < 0.1
        triangles = smooth.bound.triangles
        assert np.allclose(
            mesh.positions[mesh.triangles], smooth.at(time_s).positions[triangles], atol=1e-6
        )
    assert off_face_deg(smooth.at(0.99)).max() > 5.0


def test_a_moving_node_without_normals_is_flat(tmp_path: Path) -> None:
    solid = trimesh.creation.box()
    file = GltfFile()
    file.node(mesh=file.mesh(solid.vertices, solid.faces), scale=[1, -2, 1])
    file.animation((0, "translation", [0.0, 1.0], [[0, 0, 0], [1, 0, 0]], "LINEAR"))
    mesh = load_animated_mesh(file.write(tmp_path / "box.glb"), 0).at(0.5)
    assert off_face_deg(mesh).max() < 0.1


def test_bad_normals_among_given_ones_are_replaced(tmp_path: Path) -> None:
    """By those of the faces around; the given ones stay."""
    solid = trimesh.load(io.BytesIO(CUBE.encode()), file_type="obj", process=False)
    given = solid.vertices / np.sqrt(3.0)
    given[0] = 0.0
    text = CUBE.partition("f ")[0] + "".join(f"vn {x} {y} {z}\n" for x, y, z in given)
    text += "".join(f"f {a}//{a} {b}//{b} {c}//{c}\n" for a, b, c in solid.faces + 1)
    (tmp_path / "c.obj").write_text(text)
    mesh = load_mesh(tmp_path / "c.obj")
    bad = (mesh.positions == solid.vertices[0]).all(axis=1)
    assert bad.sum() == 3
    assert (~bad).sum() == 7, "given normals need no division"
    assert np.abs(mesh.normals[bad]).max(axis=1) == pytest.approx(1.0)
    assert np.allclose(mesh.normals[~bad], mesh.positions[~bad] / np.sqrt(3.0), atol=1e-6)
