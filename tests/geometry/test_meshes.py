"""Meshes: geometry, normals, materials; what is dropped is named, what is wrong is one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual.material import PBRMaterial

from iprt.errors import FormatError
from iprt.geometry import mesh_shapes
from iprt.geometry.material import Material
from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_files import GltfFile
from tests.scene.files import CUBE


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_cube_of_obj(tmp_path: Path) -> None:
    mesh = load_mesh(write(tmp_path / "cube.obj", CUBE))
    assert len(mesh.triangles) == 12
    assert len(mesh.positions) == 24, "three faces meet at a corner"
    assert ((mesh.normals * mesh.positions).sum(axis=-1) == 1.0).all()
    corners = mesh.positions[mesh.triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((face * corners.mean(axis=1)).sum(-1) > 0).all(), "counter-clockwise from outside"
    assert mesh.uvs.shape == (len(mesh.positions), 2)
    assert mesh.positions.dtype == mesh.normals.dtype == np.float32
    assert mesh.triangles.dtype == mesh.material_index.dtype == np.int32


MIXED = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n"
MIXED += "o a\nf 1/1 2/2 3/3\no b\nf 1/3 3/1 4/2\nl 1 2\n"


@pytest.mark.parametrize("lines", [CUBE, MIXED], ids=["cube", "mixed"])
def test_kept_shapes_are_the_ones_that_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: str
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    file, clay = write(tmp_path / "mesh.obj", lines), Material("diffuse")
    made = load_mesh(file, clay)
    monkeypatch.setattr(mesh_shapes, "WORTH_KEEPING", 1)
    first = load_mesh(file, clay)
    monkeypatch.setattr(trimesh, "load_scene", None)  # not called
    for mesh in (first, load_mesh(file, clay)):
        for name, values in vars(made).items():
            np.testing.assert_array_equal(getattr(mesh, name), values)


def test_obj_materials_stay_apart(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.png")
    write(
        tmp_path / "m.mtl",
        "newmtl matte\nKd 0.8 0.1 0.015\nmap_Kd t.png\nmap_Bump b.png\n"
        "newmtl shiny\nKd 0 0 1\nKs 0.5 0.5 0.5\nNs 198\n",
    )
    text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0.25 1\n"
    text += "usemtl matte\nf 1/1 2/2 3/3\nusemtl shiny\nf 1/1 2/2 4/3\nl 1 2\n"
    mesh = load_mesh(write(tmp_path / "m.obj", text))
    by_kind = {m.kind: (i, m) for i, m in enumerate(mesh.materials)}
    index, matte = by_kind["diffuse"]
    assert matte.albedo == pytest.approx((0.8, 0.1, 0.015))
    assert matte.texture is not None
    assert np.allclose(matte.texture, [1, 0, 0])
    assert by_kind["plastic"][1].alpha == pytest.approx(0.1)
    (triangle,) = mesh.triangles[mesh.material_index == index]
    assert np.allclose(mesh.positions[triangle], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert np.allclose(mesh.uvs[triangle], [[0, 0], [1, 0], [0.25, 1]])
    assert "lines" in mesh.dropped
    assert any("bump" in phrase for phrase in mesh.dropped)


def gltf(path: Path, **material: Any) -> Path:
    """A textured quad in glTF, moved and mirrored by its node."""
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    visual = trimesh.visual.TextureVisuals(uv=uv, material=PBRMaterial(name="m", **material))
    mesh = trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, transform=np.array(MIRRORED, float))
    scene.export(str(path))
    return path


MIRRORED = [[-1, 0, 0, 5], [0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_gltf_node_texture_and_roughness(tmp_path: Path, suffix: str) -> None:
    image = Image.new("RGB", (2, 2), (188, 0, 0))
    image.putpixel((0, 0), (0, 188, 0))  # top left: u < 0.5, v > 0.5
    mesh = load_mesh(
        gltf(
            tmp_path / f"q{suffix}",
            baseColorTexture=image,
            baseColorFactor=[0.5, 1.0, 1.0, 1.0],
            metallicFactor=0.0,
            roughnessFactor=0.5,
            normalTexture=Image.new("RGB", (1, 1)),
        )
    )
    assert mesh.positions[:, 0].min() == 4.0
    assert mesh.positions[:, 1].max() == 2.0
    corners = mesh.positions[mesh.triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (face[:, 2] > 0).all(), "a mirrored node keeps the outside outside"
    (material,) = mesh.materials
    assert material.kind == "plastic"
    assert material.alpha == pytest.approx(0.25)
    assert material.albedo == pytest.approx((0.5, 1.0, 1.0), abs=3e-3)
    assert material.texture is not None
    assert np.allclose(material.texture[0, 0], [0, 0.5, 0], atol=3e-3), "row 0 is v = 1"
    top_left = np.argmin(np.abs(mesh.positions - [5, 2, 0]).sum(axis=1))
    assert np.allclose(mesh.uvs[top_left], [0, 1])
    assert material.normal_texture is not None
    assert mesh.dropped == ()


@pytest.mark.parametrize(
    ("metallic", "roughness", "kind", "alpha"),
    [
        (1.0, 0.3, "principled", 0.09),
        (0.4, 1.0, "principled", 1.0),
        (0.0, 0.3, "plastic", 0.09),
        (0.0, 1.0, "diffuse", None),
    ],
)
def test_pbr_to_kind(
    tmp_path: Path, metallic: float, roughness: float, kind: str, alpha: float | None
) -> None:
    path = gltf(tmp_path / "q.glb", metallicFactor=metallic, roughnessFactor=roughness)
    (material,) = load_mesh(path).materials
    assert material.kind == kind
    assert material.metallic == metallic
    if alpha is not None:
        assert material.alpha == pytest.approx(alpha)


def test_dark_gltf_colors_keep_their_value(tmp_path: Path) -> None:
    path = gltf(tmp_path / "q.gltf", metallicFactor=0.0, roughnessFactor=1.0)
    document = json.loads(path.read_text())
    document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.001, 0.01, 0.5, 1]
    path.write_text(json.dumps(document))
    assert load_mesh(path).materials[0].albedo == pytest.approx((0.001, 0.01, 0.5))


def test_what_gltf_holds_besides_is_named(tmp_path: Path) -> None:
    path = gltf(tmp_path / "q.gltf", metallicFactor=0.0)
    document = json.loads(path.read_text())
    document["extensionsUsed"] = ["KHR_lights_punctual"]
    document["animations"] = [{"channels": [], "samplers": []}]
    path.write_text(json.dumps(document))
    assert set(load_mesh(path).dropped) == {
        "animations (1)",
        "extension KHR_lights_punctual",
    }


def test_degenerate_triangles_are_removed(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nv nan 0 0\nv 1e30 0 0\n"
    text += "f 1 2 3\nf 1 2 4\nf 1 1 2\nf 1 2 5\nf 1 3 6\n"
    mesh = load_mesh(write(tmp_path / "d.obj", text))
    assert len(mesh.triangles) == 1
    assert mesh.dropped == ("4 degenerate or non-finite triangles",)
    assert np.isfinite(mesh.positions).all()
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)


def test_small_meshes_are_not_degenerate(tmp_path: Path) -> None:
    text = "\n".join(
        line if line[0] == "f" else "v " + " ".join(f"{float(c) * 1e-6}" for c in line.split()[1:])
        for line in CUBE.strip().splitlines()
    )
    assert len(load_mesh(write(tmp_path / "tiny.obj", text)).triangles) == 12


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("m.obj", None, "no such mesh file"),
        ("m.off", "OFF", "not a PLY, OBJ, STL, glTF, GLB or USD file"),
        ("m.obj", "", "m.obj"),
        ("m.obj", "v 0 0 0\nv 1 0 0\n", "m.obj"),
        ("m.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "holds no triangles"),
        ("m.ply", "hello", "cut off or damaged"),
        ("m.gltf", "{", "cut off or damaged glTF file"),
        ("m.gltf", "[]", "cut off or damaged glTF file"),
        ("m.gltf", "{}", "m.gltf"),
        ("m.gltf", '{"images": [{"uri": "t.png"}]}', "refers to t.png, which is missing"),
    ],
)
def test_bad_meshes_are_one_line(tmp_path: Path, name: str, text: str | None, message: str) -> None:
    if text is not None:
        write(tmp_path / name, text)
    with pytest.raises(FormatError) as error:
        load_mesh(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_missing_color_texture_is_an_error(tmp_path: Path) -> None:
    write(tmp_path / "m.mtl", "newmtl a\nKd 1 1 1\nmap_Kd my texture.png\n")
    write(tmp_path / "m.obj", "mtllib m.mtl\nusemtl a\n" + CUBE)
    with pytest.raises(FormatError, match=r"refers to my texture\.png, which is missing"):
        load_mesh(tmp_path / "m.obj")


def test_cut_off_meshes_are_errors(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    for suffix in (".ply", ".glb"):
        path = tmp_path / f"s{suffix}"
        mesh.export(path)
        data = path.read_bytes()
        for fraction in (0.0, 0.1, 0.3, 0.6, 0.9):
            path.write_bytes(data[: int(fraction * len(data))])
            with pytest.raises(FormatError) as error:
                load_mesh(path)
            assert str(path) in str(error.value)


def test_strips_without_indices_or_a_scene_face_one_way(tmp_path: Path) -> None:
    file = GltfFile()
    number = file.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]], [])
    primitive = file.document["meshes"][number]["primitives"][0]
    del primitive["indices"], file.document["scenes"]
    primitive["mode"] = 5
    file.node(children=[file.node(mesh=number, translation=[0, 0, 3])], rotation=[0, 0, 2, 0])
    mesh = load_mesh(file.write(tmp_path / "s.glb"))
    assert len(mesh.triangles) == 3
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1], (len(mesh.normals), 1)))
    assert (mesh.positions[:, 2] == 3.0).all()
    assert mesh.positions[:, :2].min() == -2.0, "half a turn"
