"""Colors of vertices and faces: the textures that they become, between corners and from afar."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual.material import PBRMaterial

from iprt.files.images import decode_srgb
from iprt.geometry.animated_mesh import load_animated_mesh
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from iprt.geometry.vertex_colors import color_texture
from tests.geometry.gltf_files import GltfFile, bar, bar_vertices

HALF = 2e-3
"""Two of the rounding errors of half floats near 1, and those of texture coordinates."""


def looked_up(texture: NDArray[np.float32], uv: NDArray[np.floating]) -> NDArray[np.float32]:
    """Bilinear, repeated, row 0 at v = 1, of half floats: as cl/lib/world/objects/objects_bvh.h."""
    height, width = texture.shape[:2]
    texels = texture.astype(np.float16).astype(np.float32)
    uv = uv.astype(np.float32)
    at = (uv - np.floor(uv)) * np.array([width, -height], np.float32) - np.float32(0.5)
    low = np.floor(at).astype(int)
    part = (at - low)[..., None]
    (x, y), (right, below) = (low % [width, height]).T, ((low + 1) % [width, height]).T
    upper = texels[y, x] * (1 - part[:, 0]) + texels[y, right] * part[:, 0]
    lower = texels[below, x] * (1 - part[:, 0]) + texels[below, right] * part[:, 0]
    return np.asarray(upper * (1 - part[:, 1]) + lower * part[:, 1], np.float32)


def weights(count: int) -> NDArray[np.float64]:
    """Points of triangles, the corners of some included."""
    drawn = np.random.default_rng(7).dirichlet([0.5, 0.5, 0.5], count)
    drawn[:3] = np.eye(3)[:count]
    return drawn


def albedos(mesh: Mesh, at: NDArray[np.float64]) -> NDArray[np.float64]:
    """(F, 3) of a mesh of one material, at weights (F, 3) of the corners of its triangles."""
    (material,) = mesh.materials
    assert material.texture is not None
    uv = np.einsum("fc,fck->fk", at, mesh.uvs[mesh.triangles])
    return np.asarray(looked_up(material.texture, uv) * np.array(material.albedo))


def ball(suffix: str, folder: Path) -> tuple[Path, NDArray[np.uint8]]:
    solid = trimesh.creation.icosphere(subdivisions=2)
    rng = np.random.default_rng(3)
    colors = rng.integers(0, 256, (len(solid.vertices), 4), np.uint8)
    colors[:, 3] = 255
    solid.visual.vertex_colors = colors
    solid.export(folder / f"b{suffix}")
    return folder / f"b{suffix}", colors[solid.faces, :3]


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".glb"])
def test_colors_between_vertices_are_interpolated(suffix: str, tmp_path: Path) -> None:
    """Colors of glTF are linear, others are sRGB."""
    path, colors = ball(suffix, tmp_path)
    mesh = load_mesh(path)
    linear = colors / 255.0 if suffix == ".glb" else decode_srgb(colors)
    at = weights(len(mesh.triangles))
    expected = np.einsum("fc,fck->fk", at, linear)
    np.testing.assert_allclose(albedos(mesh, at), expected, atol=HALF)
    assert mesh.dropped == ()


def test_faces_have_one_color_each(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    colors = np.random.default_rng(3).integers(0, 256, (len(box.faces), 4), np.uint8)
    box.visual.face_colors = colors
    box.export(tmp_path / "b.ply")
    mesh = load_mesh(tmp_path / "b.ply")
    found = albedos(mesh, weights(len(mesh.triangles)))
    np.testing.assert_allclose(found, decode_srgb(colors[:, :3]), atol=HALF)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 1000])
def test_no_triangle_has_texels_of_others(count: int) -> None:
    rng = np.random.default_rng(count)
    colors = rng.random((count, 3, 3)).astype(np.float32)
    texture, uvs = color_texture(rng.random((count, 3)), colors)
    assert texture.shape[0] * texture.shape[1] < 2 * 4 * count or count == 1
    corners = looked_up(texture, uvs.reshape(-1, 2)).reshape(count, 3, 3)
    np.testing.assert_allclose(corners, colors, atol=HALF)


def test_from_afar_colors_are_those_around() -> None:
    """Blocks of texels are made of triangles that are near each other, in whatever order."""
    grid = np.stack(np.meshgrid(np.arange(64.0), np.arange(64.0), [0.0]), axis=-1).reshape(-1, 3)
    centers = np.random.default_rng(1).permutation(grid) / 63.0
    colors = np.repeat(centers[:, None], 3, axis=1).astype(np.float32)
    texture, _ = color_texture(centers, colors)
    assert texture.shape == (128, 128, 3)
    blocks = texture.reshape(8, 16, 8, 16, 3)
    assert blocks.std(axis=(1, 3)).max() < 0.04, "of 0.29 in all of it"


def test_one_color_needs_no_texture(tmp_path: Path) -> None:
    solid = trimesh.creation.box()
    solid.visual.vertex_colors = np.tile(np.array([255, 188, 0, 255], np.uint8), (8, 1))
    solid.export(tmp_path / "b.ply")
    mesh = load_mesh(tmp_path / "b.ply")
    (material,) = mesh.materials
    assert material.texture is None
    assert material.albedo == pytest.approx((1.0, 0.503, 0.0), abs=1e-3)
    assert mesh.dropped == ()


def test_colors_multiply_the_material_and_share_its_texture(tmp_path: Path) -> None:
    file = GltfFile()
    rng = np.random.default_rng(5)
    linear = rng.random((2, 3, 3))
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for each, colors in enumerate(linear):
        number = file.mesh(np.add(corners, [each, 0, 0]), [[0, 1, 2]], COLOR_0=file.array(colors))
        file.document["meshes"][number]["primitives"][0]["material"] = 0
        file.node(mesh=number)
    pbr = {"baseColorFactor": [0.5, 0.25, 1.0, 1.0], "metallicFactor": 0.0}
    file.document["materials"] = [{"pbrMetallicRoughness": pbr}]
    file.document["scenes"] = [{"nodes": [0, 1]}]
    mesh = load_mesh(file.write(tmp_path / "c.glb"))
    at = weights(2)
    order = np.argsort(mesh.positions[mesh.triangles][:, :, 0].min(axis=1))
    expected = np.einsum("fc,fck->fk", at, linear[order]) * [0.5, 0.25, 1.0]
    np.testing.assert_allclose(albedos(mesh, at), expected, atol=HALF)


def test_below_a_texture_their_mean_is_used(tmp_path: Path) -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    image = Image.new("RGB", (2, 2), (255, 0, 0))
    material = PBRMaterial(baseColorTexture=image, metallicFactor=0.0)
    visual = trimesh.visual.TextureVisuals(uv=np.array(corners)[:, :2], material=material)
    visual.vertex_attributes["color"] = np.array(
        [[51, 255, 0, 255], [102, 255, 0, 255], [153, 255, 0, 255]], np.uint8
    )
    solid = trimesh.Trimesh(corners, [[0, 1, 2]], visual=visual, process=False)
    solid.export(tmp_path / "t.glb")
    mesh = load_mesh(tmp_path / "t.glb")
    (found,) = mesh.materials
    assert found.texture is not None
    assert found.texture.shape == (2, 2, 3)
    assert found.albedo == pytest.approx((0.4, 1.0, 0.0), abs=2e-3)
    assert mesh.dropped == ("colors of vertices below a texture; their mean is used",)


@pytest.mark.parametrize("normals", [True, False])
def test_colors_bend_along(tmp_path: Path, normals: bool) -> None:
    file = bar(smooth=True)
    positions, _, triangles = bar_vertices()
    linear = np.random.default_rng(2).random((len(positions), 3))
    attributes = file.document["meshes"][0]["primitives"][0]["attributes"]
    attributes["COLOR_0"] = file.array(linear)
    if not normals:
        del attributes["NORMAL"]
    path = file.write(tmp_path / "b.glb")
    at = weights(len(triangles))
    expected = np.einsum("fc,fck->fk", at, linear[triangles])
    animated = load_animated_mesh(path, 0)
    for mesh in (load_mesh(path), animated.at(0.0), animated.at(0.7)):
        np.testing.assert_allclose(albedos(mesh, at), expected, atol=HALF)
    corners = load_mesh(path).positions[load_mesh(path).triangles]
    np.testing.assert_allclose(corners, positions[triangles], atol=1e-6)


def test_another_material_leaves_the_mesh_as_it_is(tmp_path: Path) -> None:
    path, _ = ball(".ply", tmp_path)
    mesh = load_mesh(path, Material())
    assert mesh.materials == (Material(),)
    assert len(mesh.positions) == 162, "no vertex is divided"
    assert mesh.dropped == ()


@pytest.mark.parametrize(("mode", "varied"), [("BLEND", True), ("BLEND", False), ("OPAQUE", True)])
def test_opacity_of_vertices_counts_where_the_material_has_any(
    tmp_path: Path, mode: str, varied: bool
) -> None:
    file = GltfFile()
    colors = np.random.default_rng(5).random((3, 4)) if varied else np.full((3, 4), 0.6)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    number = file.mesh(corners, [[0, 1, 2]], COLOR_0=file.array(colors))
    file.document["meshes"][number]["primitives"][0]["material"] = 0
    file.node(mesh=number)
    pbr = {"baseColorFactor": [1.0, 1.0, 1.0, 0.5], "metallicFactor": 0.0}
    file.document["materials"] = [{"pbrMetallicRoughness": pbr, "alphaMode": mode}]
    file.document["scenes"] = [{"nodes": [0]}]
    mesh = load_mesh(file.write(tmp_path / "c.glb"))
    (material,) = mesh.materials
    assert material.has_holes == (mode == "BLEND")
    if mode == "BLEND":
        at = weights(1)
        found = np.full((1, 1), material.opacity)
        if varied:
            assert material.opacity_texture is not None
            uv = np.einsum("fc,fck->fk", at, mesh.uvs[mesh.triangles])
            found = material.opacity * looked_up(material.opacity_texture[..., None], uv)
        expected = 0.5 * at @ colors[:, 3:]
        np.testing.assert_allclose(found, expected, atol=HALF)
