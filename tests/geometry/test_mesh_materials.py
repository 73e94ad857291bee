"""What materials of mesh files become, and that what is lost of them is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.mesh_materials import DEFAULT_MATERIAL
from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_files import GltfFile
from tests.geometry.test_meshes import gltf
from tests.scene.files import CUBE


def of_mtl(folder: Path, *lines: str) -> Mesh:
    (folder / "m.mtl").write_text("\n".join(["newmtl a", *lines]))
    (folder / "m.obj").write_text("mtllib m.mtl\nusemtl a\n" + CUBE)
    return load_mesh(folder / "m.obj")


@pytest.mark.parametrize(
    ("lines", "material"),
    [
        (["Kd 1 0 0", "Pr 0.5"], Material("plastic", (1, 0, 0), alpha=0.25)),
        (["Kd 1 0 0", "Pr 0.95"], Material("diffuse", (1, 0, 0))),
        (["Kd 1 0.5 0", "Pr 0.2", "Pm 1"],
         Material("principled", (1, 0.5, 0), alpha=0.04, metallic=1)),
        (["Kd 1 0 0", "Ks 1 1 1", "Ns 198", "Pm 0.5"],
         Material("principled", (1, 0, 0), alpha=0.1, metallic=0.5)),
        (["Kd 1 0 0", "Ks 1 1 1", "Ns 198"], Material("plastic", (1, 0, 0), alpha=0.1)),
        (["Kd 1 0 0", "Ks 1 1 1", "Ns 198", "Ni 1.8"],
         Material("plastic", (1, 0, 0), alpha=0.1, ior=1.8)),
        (["Kd 1 0 0", "Ks 1 1 1", "Ns 198", "Ni 1"], Material("plastic", (1, 0, 0), alpha=0.1)),
        (["Kd 0.5"], Material("diffuse", (0.5, 0.5, 0.5))),
        (["Kd 1 0 0", "Pr nan", "Pm inf"], Material("diffuse", (1, 0, 0))),
        (["Kd 1 0 0", "illum 7", "Ni 1.33"],
         Material("dielectric", (1, 1, 1), alpha=0.0, ior=1.33)),
        (["Tf 0.5 1 1", "illum 6", "Ns 198", "d 0.1"],
         Material("dielectric", (0.5, 1, 1), alpha=0.1)),
    ],
)  # fmt: skip
def test_mtl_to_kind(tmp_path: Path, lines: list[str], material: Material) -> None:
    mesh = of_mtl(tmp_path, *lines)
    (found,) = mesh.materials
    assert (found.kind, found.albedo) == (material.kind, material.albedo)
    assert found.metallic == material.metallic
    if found.kind != "diffuse":
        assert (found.alpha, found.ior) == pytest.approx((material.alpha, material.ior))
    assert mesh.dropped == ()


@pytest.mark.parametrize(
    ("line", "phrase"),
    [
        ("map_d t.png", "map of opacity"),
        ("map_Ka t.png", "texture map_ka"),
        ("Tf 1 0 0", "a transmission filter (Tf)"),
        ("Pc 0.5", "'pc' of its materials"),
        ("map_Pr r.png", "texture map_pr"),
        ("norm n.png", "texture norm"),
    ],
)
def test_what_mtl_says_and_is_not_read_is_named(tmp_path: Path, line: str, phrase: str) -> None:
    assert of_mtl(tmp_path, "Kd 1 0 0", line).dropped == (phrase,)


@pytest.mark.parametrize(
    ("line", "opacity"),
    [("d 0.4", 0.4), ("Tr 0.6", 0.4), ("d 2", 1.0), ("Tr 1", 1.0), ("d 0", 1.0)],
)
def test_mtl_opacity(tmp_path: Path, line: str, opacity: float) -> None:
    mesh = of_mtl(tmp_path, "Kd 0.5 0.5 0.5", line)
    assert mesh.materials[0].opacity == pytest.approx(opacity)
    assert mesh.dropped == ()


def test_mtl_emits(tmp_path: Path) -> None:
    mesh = of_mtl(tmp_path, "Kd 0.5 0.5 0.5", "Ks 0.5 0.5 0.5", "Ns 100", "Ke 2 0.5 30")
    (material,) = mesh.materials
    assert (material.kind, material.emission) == ("plastic", (2.0, 0.5, 30.0))
    assert mesh.dropped == ()


@pytest.mark.parametrize(
    "line", ["Ke 0 0 0", "Ka 1 1 1", "illum 2", "d 1", "Tr 0", "Tf 1 1 1", "Ps 0", "Pm 0", "Pm 1"]
)
def test_what_says_nothing_is_not_named(tmp_path: Path, line: str) -> None:
    assert of_mtl(tmp_path, "Kd 1 0 0", line).dropped == ()


@pytest.mark.parametrize("dtype", ["u1", "u2", "f4"])
def test_colors_of_gltf_multiply_that_of_the_material(dtype: str, tmp_path: Path) -> None:
    file = GltfFile()
    top = 1.0 if dtype == "f4" else np.iinfo(dtype).max
    colors = np.tile([0.4, 1.0, 0.0], (3, 1)) * top
    more = {} if dtype == "f4" else {"normalized": True}
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    number = file.mesh(corners, [[0, 1, 2]], COLOR_0=file.array(colors, dtype, **more))
    pbr = {"baseColorFactor": [0.5] * 3 + [1.0], "metallicFactor": 0.0}
    file.document["materials"] = [{"pbrMetallicRoughness": pbr}]
    file.document["meshes"][number]["primitives"][0]["material"] = 0
    file.node(mesh=number)
    (material,) = load_mesh(file.write(tmp_path / "c.glb")).materials
    expected = 0.5 * np.array([0.4, 1.0, 0.0])
    assert material.albedo == pytest.approx(expected, abs=5e-3)


def test_texture_coordinates_and_borders_that_are_not_read_are_named(tmp_path: Path) -> None:
    path = gltf(tmp_path / "q.gltf", baseColorTexture=Image.new("RGB", (2, 2)), metallicFactor=0.0)
    document = json.loads(path.read_text())
    assert load_mesh(path).dropped == ()
    document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 2
    path.write_text(json.dumps(document))
    assert load_mesh(path).dropped == ("a third set of texture coordinates; the first is used",)


def test_the_picture_of_the_color_is_not_named_where_it_lights_from_nowhere_too(
    tmp_path: Path,
) -> None:
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.png")
    mesh = of_mtl(tmp_path, "Kd 1 1 1", "map_Ka t.png", "map_Kd t.png")
    assert mesh.materials[0].texture is not None
    assert mesh.dropped == ()


def test_a_missing_mtl_file_leaves_the_mesh_grey(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "m.obj").write_text("mtllib none.mtl\nusemtl a\n" + CUBE)
    mesh = load_mesh(tmp_path / "m.obj")
    assert mesh.materials == (DEFAULT_MATERIAL,)
    (line,) = caplog.messages
    assert line.startswith(f"{tmp_path / 'm.obj'}: refers to none.mtl, which is missing")
    assert mesh.warnings == (line.partition(": ")[2],)
    assert load_mesh(tmp_path / "m.obj", Material()).warnings == ()


def test_a_texture_of_another_material_model_is_read_and_not_named(tmp_path: Path) -> None:
    """KHR_materials_pbrSpecularGlossiness, which trimesh converts."""
    path = gltf(tmp_path / "q.gltf", baseColorTexture=Image.new("RGB", (2, 2), (255, 0, 0)))
    document = json.loads(path.read_text())
    pbr = document["materials"][0].pop("pbrMetallicRoughness")
    values = {"diffuseTexture": pbr["baseColorTexture"], "specularFactor": [0.04] * 3}
    document["materials"][0]["extensions"] = {"KHR_materials_pbrSpecularGlossiness": values}
    document["extensionsUsed"] = ["KHR_materials_pbrSpecularGlossiness"]
    path.write_text(json.dumps(document))
    mesh = load_mesh(path)
    assert mesh.materials[0].texture is not None
    red = np.tile([1.0, 0.0, 0.0], (2, 2, 1))
    np.testing.assert_allclose(mesh.materials[0].texture, red, atol=0.01)
    assert not any("extension" in phrase for phrase in mesh.dropped)


def test_smoothing_groups_are_named_where_they_would_matter(tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text("s 1\n" + CUBE)
    assert load_mesh(tmp_path / "m.obj").dropped == ("smoothing groups",)
    text = "vn 0 0 1\nv 0 0 0\nv 1 0 0\nv 0 1 0\ns 1\nf 1//1 2//1 3//1\n"
    (tmp_path / "m.obj").write_text(text)
    assert load_mesh(tmp_path / "m.obj").dropped == ()


def test_other_elements_of_ply_are_named(tmp_path: Path) -> None:
    text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    text += "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
    text += "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    (tmp_path / "m.ply").write_text(text + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n0 1\n")
    assert load_mesh(tmp_path / "m.ply").dropped == ("element 'edge'",)
