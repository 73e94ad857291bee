"""UsdPreviewSurface becomes a material, and its losses are named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from tests.geometry.usd_files import READER, in_this_process, surface, texture, usda  # noqa: F401

pytest.importorskip("pxr", reason="needs the extra `usd`")
pytestmark = pytest.mark.usefixtures("in_this_process")


def read(folder: Path, inputs: str, nodes: str = "", more: str = "") -> tuple[Material, Mesh]:
    mesh = load_mesh(usda(folder / "a.usda", surface(inputs, nodes, more)))
    (material,) = mesh.materials
    return material, mesh


@pytest.mark.parametrize(
    ("inputs", "material"),
    [
        (
            "color3f inputs:diffuseColor = (1, 0, 0)\nfloat inputs:roughness = 0.5",
            Material("plastic", (1, 0, 0), alpha=0.25),
        ),
        ("float inputs:roughness = 1", Material("diffuse", (0.18, 0.18, 0.18))),
        (
            "float inputs:metallic = 1\nfloat inputs:roughness = 0\nfloat inputs:ior = 1.45",
            Material("principled", (0.18,) * 3, alpha=0.0, ior=1.45, metallic=1.0),
        ),
        (
            "color3f inputs:emissiveColor = (3, 2, 1)\nfloat inputs:roughness = 1",
            Material("diffuse", (0.18,) * 3, emission=(3, 2, 1)),
        ),
        (
            "float inputs:opacity = 0\nfloat inputs:roughness = 0\n"
            "color3f inputs:diffuseColor = (1, 1, 1)",
            # The square is open, and so a pane.
            Material("dielectric", (1, 1, 1), alpha=0.0, thin=True),
        ),
        (
            'token inputs:opacityMode = "presence"\nfloat inputs:opacity = 0.25\n'
            "float inputs:roughness = 1",
            Material("diffuse", (0.18,) * 3, opacity=0.25),
        ),
        (
            "float inputs:opacity = 0.7\nfloat inputs:opacityThreshold = 0.5\n"
            "float inputs:roughness = 1",
            Material("diffuse", (0.18,) * 3, opacity=0.7, cutoff=0.5),
        ),
    ],
)
def test_inputs(tmp_path: Path, inputs: str, material: Material) -> None:
    found = read(tmp_path, inputs)[0]
    for name in ("albedo", "emission"):
        assert getattr(found, name) == pytest.approx(getattr(material, name))
    for name in ("alpha", "ior", "metallic", "opacity", "cutoff"):
        assert getattr(found, name) == pytest.approx(getattr(material, name)), name
    assert (found.kind, found.thin) == (material.kind, material.thin)


def test_textures(tmp_path: Path) -> None:
    Image.new("RGBA", (4, 2), (255, 0, 0, 51)).save(tmp_path / "color.png")
    Image.new("L", (2, 2), 128).save(tmp_path / "rough.png")
    Image.new("RGB", (8, 8), (0, 0, 255)).save(tmp_path / "metal.png")
    Image.new("RGB", (2, 2), (255, 128, 128)).save(tmp_path / "bumps.png")
    nodes = READER + texture("color", "color.png", 'token inputs:wrapS = "mirror"')
    nodes += texture("rough", "./rough.png") + texture("metal", "metal.png")
    bias = "float4 inputs:scale = (2, 2, 2, 1)\nfloat4 inputs:bias = (-1, -1, -1, 0)"
    nodes += texture("bumps", "bumps.png", bias)
    inputs = "\n".join(
        [
            "color3f inputs:diffuseColor.connect = </thing/look/color.outputs:rgb>",
            "float inputs:opacity.connect = </thing/look/color.outputs:a>",
            "float inputs:roughness.connect = </thing/look/rough.outputs:r>",
            "float inputs:metallic.connect = </thing/look/metal.outputs:b>",
            "normal3f inputs:normal.connect = </thing/look/bumps.outputs:rgb>",
        ]
    )
    material, mesh = read(tmp_path, inputs, nodes)
    assert mesh.dropped == ()
    assert material.kind == "principled"
    assert material.texture is not None
    np.testing.assert_array_equal(material.texture[0, 0], [1, 0, 0])
    assert material.opacity_texture is not None
    assert material.opacity_texture.shape == (2, 4)
    np.testing.assert_allclose(material.opacity_texture, 0.2)
    assert material.surface_texture is not None
    np.testing.assert_allclose(material.surface_texture, [[[1, 128 / 255]] * 8] * 8, rtol=1e-6)
    assert (material.metallic, material.alpha) == (1.0, 1.0)
    assert material.normal_texture is not None
    np.testing.assert_allclose(material.normal_texture[0, 0], [1, 0, 0], atol=0.005)
    assert material.samplers[0].wrap == ("mirror", "repeat")
    assert mesh.tangents is not None


PLACE = """
        def Shader "place"
        {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </thing/look/reader.outputs:result>
            float inputs:rotation = 90
            float2 inputs:scale = (2, 3)
            float2 inputs:translation = (0.5, 0)
            float2 outputs:result
        }
"""


def test_coordinates_are_scaled_then_turned_then_moved(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    node = texture("t", "t.png").replace("reader.outputs:result", "place.outputs:result")
    inputs = "color3f inputs:diffuseColor.connect = </thing/look/t.outputs:rgb>"
    _, mesh = read(tmp_path, inputs, READER + PLACE + node)
    seen = {tuple(p): tuple(uv) for p, uv in zip(mesh.positions, mesh.uvs.round(5), strict=True)}
    assert seen[1, 0, 0] == (0.5, 2)
    assert seen[0, 1, 0] == (-2.5, 0)


@pytest.mark.parametrize("primvar", ["st", "other"])
def test_a_normal_map_lies_elsewhere(tmp_path: Path, primvar: str) -> None:
    """The color has no transform; the other primvar has twice the coordinates, by corner."""
    Image.new("RGB", (2, 2), (128, 128, 255)).save(tmp_path / "t.png")
    second = READER.replace('"reader"', '"second"').replace('"st"', f'"{primvar}"')
    nodes = READER + second + PLACE.replace("reader.outputs", "second.outputs")
    nodes += texture("color", "t.png")
    nodes += texture("bumps", "t.png").replace("reader.outputs:result", "place.outputs:result")
    inputs = (
        "color3f inputs:diffuseColor.connect = </thing/look/color.outputs:rgb>\n"
        "normal3f inputs:normal.connect = </thing/look/bumps.outputs:rgb>"
    )
    more = """texCoord2f[] primvars:other = [(0, 0), (2, 0), (2, 2), (0, 2)] (
            interpolation = "faceVarying"
        )"""
    material, mesh = read(tmp_path, inputs, nodes, more)
    assert (mesh.uvs2 is None) == (primvar == "st")
    place = material.places[1]
    assert place is not None
    np.testing.assert_allclose(mesh.uvs, mesh.positions[:, :2])
    factor = 1.0 if primvar == "st" else 2.0
    x, y = factor * mesh.positions[:, :2].T
    wanted = np.stack([0.5 - 3.0 * y, 2.0 * x], axis=-1)
    np.testing.assert_allclose(place.coordinates(mesh.uvs, mesh.uvs2), wanted, atol=1e-6)
    # It grows to the right along -y.
    assert mesh.tangents is not None
    down = np.tile([0.0, -1.0, 0.0, 1.0], (len(mesh.tangents), 1))
    np.testing.assert_allclose(mesh.tangents, down, atol=1e-6)
    assert "texture coordinates" not in " ".join(mesh.dropped)


def test_a_linear_picture_is_not_decoded(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (51, 51, 51)).save(tmp_path / "t.png")
    node = texture("t", "t.png", 'token inputs:sourceColorSpace = "raw"')
    inputs = "color3f inputs:diffuseColor.connect = </thing/look/t.outputs:rgb>"
    material, _ = read(tmp_path, inputs, READER + node)
    assert material.texture is not None
    np.testing.assert_allclose(material.texture, 0.2)


def test_colors_of_vertices_are_read_where_the_material_reads_them(tmp_path: Path) -> None:
    more = "color3f[] primvars:displayColor = [(0, 1, 0)]"
    assert read(tmp_path, "float inputs:roughness = 1", "", more)[0].albedo[0] > 0.1
    node = """
        def Shader "colors"
        {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "displayColor"
            float3 outputs:result
        }
"""
    inputs = "color3f inputs:diffuseColor.connect = </thing/look/colors.outputs:result>"
    material, mesh = read(tmp_path, inputs, node, more)
    assert material.albedo == (0, 1, 0)
    assert mesh.dropped == ()


def test_a_normal_map_bends_the_clear_coat_too(tmp_path: Path) -> None:
    Image.fromarray(np.full((2, 2, 3), 200, np.uint8)).save(tmp_path / "n.png")
    inputs = "normal3f inputs:normal.connect = </thing/look/n.outputs:rgb>\n"
    plain, _ = read(tmp_path, inputs, READER + texture("n", "n.png"))
    assert plain.normal_texture is not None
    assert plain.clearcoat_normal_texture is None
    inputs += "float inputs:clearcoat = 0.75\n"
    coated, _ = read(tmp_path, inputs, READER + texture("n", "n.png"))
    assert coated.normal_texture is not None
    assert coated.clearcoat_normal_texture is coated.normal_texture
    assert coated.map_places[4] == coated.map_places[2]


@pytest.mark.parametrize("metallic", [0.0, 0.5])
def test_a_clear_coat(tmp_path: Path, metallic: float) -> None:
    """It has the means of its maps, of roughness the mean of the square, and their palette."""
    inputs = f"float inputs:metallic = {metallic}\nfloat inputs:roughness = 0.5\n"
    plain, _ = read(tmp_path, inputs)
    coat = inputs + "float inputs:clearcoat = 0.75\nfloat inputs:clearcoatRoughness = 0.2\n"
    material, mesh = read(tmp_path, coat)
    assert material.clearcoat == 0.75
    assert material.clearcoat_alpha == pytest.approx(0.04)
    assert replace(material, clearcoat=0.0, clearcoat_alpha=0.0, kind=plain.kind) == plain
    assert mesh.dropped == ()
    pixels = np.array([[[0, 0, 0], [255, 51, 0]]], np.uint8)
    Image.fromarray(pixels).save(tmp_path / "t.png")
    mapped = inputs + "float inputs:clearcoat.connect = </thing/look/t.outputs:r>\n"
    mapped += "float inputs:clearcoatRoughness.connect = </thing/look/t.outputs:g>"
    material, mesh = read(tmp_path, mapped, READER + texture("t", "t.png"))
    assert material.clearcoat == pytest.approx(0.5)
    assert material.clearcoat_alpha == pytest.approx(0.5 * 0.04)
    assert mesh.dropped == ()
    assert material.variants is not None
    assert [one.clearcoat for one in material.palette] == [0.0, 1.0]
    alphas = [one.clearcoat_alpha for one in material.palette]
    assert alphas == pytest.approx([0.0, 0.04])
    assert material.variants.index.tolist() == [[0, 1]]


def test_what_is_not_read_is_named(tmp_path: Path) -> None:
    inputs = "float inputs:displacement = 1\nint inputs:useSpecularWorkflow = 1\n"
    inputs += "color3f inputs:specularColor = (0.9, 0.6, 0.3)"
    material, mesh = read(tmp_path, inputs)
    assert mesh.dropped == ("specular color, except to tell metals", "displacement")
    assert material.metallic == 1.0
    assert material.albedo == pytest.approx((0.9, 0.6, 0.3))
    other = surface("").replace('"UsdPreviewSurface"', '"ND_standard_surface"')
    mesh = load_mesh(usda(tmp_path / "b.usda", other))
    assert mesh.dropped == ("material look, which has no UsdPreviewSurface",)
    assert mesh.materials[0].kind == "diffuse"
    inputs = "color3f inputs:diffuseColor.connect = </thing/look/t.outputs:rgb>"
    _, mesh = read(tmp_path, inputs, READER + texture("t", "t.<UDIM>.png"))
    assert mesh.dropped == ("texture t.<UDIM>.png",)


def test_inputs_may_come_from_the_material_and_bindings_from_old_files(tmp_path: Path) -> None:
    """Bindings without an applied schema, as files had them once."""
    Image.new("RGB", (2, 2), (255, 255, 255)).save(tmp_path / "t.png")
    reader = READER.replace(
        'inputs:varname = "st"', "inputs:varname.connect = </thing/look.inputs:coordinates>"
    )
    inputs = "color3f inputs:diffuseColor.connect = </thing/look.inputs:tint>\n"
    inputs += "color3f inputs:emissiveColor.connect = </thing/look/t.outputs:rgb>"
    body = surface(inputs, reader + texture("t", "t.png"))
    body = body.replace(' (prepend apiSchemas = ["MaterialBindingAPI"])', "")
    body = body.replace("primvars:st", "primvars:Texture_uv").replace(
        "(1, 0), (1, 1)", "(2, 0), (1, 1)"
    )
    own = '    string inputs:coordinates = "Texture_uv"\n        color3f inputs:tint = (1, 0, 0)\n'
    head = 'def Material "look"\n    {\n'
    body = body.replace(head, head + own)
    mesh = load_mesh(usda(tmp_path / "a.usda", body))
    (material,) = mesh.materials
    assert material.albedo == (1, 0, 0)
    assert material.emission == (1, 1, 1)
    assert mesh.uvs.max() == 2
