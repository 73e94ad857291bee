"""Metallic-roughness materials of glTF: maps, and how textures are placed."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from iprt.errors import FormatError
from iprt.geometry.material import Material, Sampler
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from tests.geometry.gltf_files import GltfFile

CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
UVS = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
"""Texture coordinates as stored, v down, of a square with the picture upright."""
OTHER = 0.25 * UVS + 0.5


def quad(
    folder: Path,
    pbr: dict[str, Any],
    *images: np.ndarray,
    sets: tuple[np.ndarray, ...] = (UVS,),
    samplers: list[dict[str, Any]] | None = None,
    **more: Any,
) -> Mesh:
    """Load a square whose material refers to textures 0, 1 and so on, (H, W, 3 or 4) uint8 each.

    `more` are further keys of the material.
    """
    file = GltfFile()
    attributes = {f"TEXCOORD_{i}": file.array(uvs) for i, uvs in enumerate(sets)}
    number = file.mesh(CORNERS, [[0, 1, 2], [0, 2, 3]], **attributes)
    file.document["meshes"][number]["primitives"][0]["material"] = 0
    file.document["materials"] = [{"pbrMetallicRoughness": pbr, **more}]
    file.document["textures"] = [{"source": i} for i in range(len(images))]
    file.document["images"] = []
    for texture, sampler in zip(
        file.document["textures"], range(len(samplers or [])), strict=False
    ):
        texture["sampler"] = sampler
    file.document["samplers"] = samplers or []
    for image in images:
        with BytesIO() as stream:
            Image.fromarray(image).save(stream, "PNG")
            stored = np.frombuffer(stream.getvalue(), np.uint8)
        view = file.document["accessors"][file.array(stored[:, None], "u1")]["bufferView"]
        file.document["images"].append({"bufferView": view, "mimeType": "image/png"})
    file.node(mesh=number)
    return load_mesh(file.write(folder / "q.glb"))


def noise(*shape: int) -> np.ndarray:
    return np.random.default_rng(5).integers(0, 256, (*shape, 3), dtype=np.uint8)


def test_a_metallic_roughness_map_scales_its_factors(tmp_path: Path) -> None:
    """Blue is metalness, green roughness, both linear; red is occlusion's and not read."""
    stored = noise(3, 5)
    pbr = {"metallicFactor": 0.5, "roughnessFactor": 0.8}
    mesh = quad(tmp_path, pbr | {"metallicRoughnessTexture": {"index": 0}}, stored)
    (material,) = mesh.materials
    expected = Material("principled", (1, 1, 1), alpha=0.64, metallic=0.5)
    assert (material.kind, material.metallic) == (expected.kind, expected.metallic)
    assert material.alpha == pytest.approx(expected.alpha)
    assert material.texture is None
    assert material.surface_texture is not None
    np.testing.assert_allclose(material.surface_texture, stored[..., [2, 1]] / 255, atol=1e-6)
    assert mesh.dropped == ()
    assert mesh.warnings == ()


def test_color_and_surface_share_the_texture_coordinates(tmp_path: Path) -> None:
    color, surface = noise(2, 2), noise(4, 4)
    pbr = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}
    (material,) = quad(tmp_path, pbr, color, surface).materials
    assert material.texture is not None
    assert material.surface_texture is not None
    assert material.texture.shape == (2, 2, 3)
    assert material.surface_texture.shape == (4, 4, 2)


@pytest.mark.parametrize("through", ["texCoord", "transform"])
def test_the_second_set_of_texture_coordinates(tmp_path: Path, through: str) -> None:
    texture: dict[str, Any] = {"index": 0, "texCoord": 1}
    if through == "transform":
        texture = {"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    mesh = quad(tmp_path, {"baseColorTexture": texture}, noise(2, 2), sets=(UVS, OTHER))
    np.testing.assert_allclose(sorted_uvs(mesh), OTHER * [1, -1] + [0, 1], atol=1e-6)
    assert mesh.dropped == ()


@pytest.mark.parametrize(
    ("transform", "expected"),
    [
        ({"offset": [0.25, 0.5]}, UVS + np.array([0.25, 0.5])),
        ({"scale": [2.0, 0.5]}, UVS * [2.0, 0.5]),
        # A quarter turn, counter-clockwise as the image shows it: right becomes up, down right.
        ({"rotation": np.pi / 2}, np.stack([UVS[:, 1], -UVS[:, 0]], -1)),
        (
            {"rotation": np.pi / 2, "scale": [2.0, 1.0], "offset": [0.1, 0.2]},
            np.stack([UVS[:, 1] + 0.1, -2.0 * UVS[:, 0] + 0.2], -1),
        ),
    ],
)
def test_texture_transforms(
    tmp_path: Path, transform: dict[str, Any], expected: np.ndarray
) -> None:
    texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    mesh = quad(tmp_path, {"baseColorTexture": texture}, noise(2, 2))
    np.testing.assert_allclose(sorted_uvs(mesh), expected * [1, -1] + [0, 1], atol=1e-6)
    assert mesh.warnings == ()


def test_textures_that_lie_differently_are_named(tmp_path: Path) -> None:
    moved = {"index": 1, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    pbr = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": moved}
    mesh = quad(tmp_path, pbr, noise(2, 2), noise(2, 2))
    assert mesh.dropped == (
        "texture coordinates that differ between a material's textures; the color's are used",
    )
    np.testing.assert_allclose(sorted_uvs(mesh), UVS * [1, -1] + [0, 1], atol=1e-6)


def test_samplers(tmp_path: Path) -> None:
    pbr = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}
    samplers = [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}, {"magFilter": 9729}]
    (material,) = quad(tmp_path, pbr, noise(2, 2), noise(2, 2), samplers=samplers).materials
    assert material.samplers == (Sampler(("clamp", "mirror"), nearest=True), Sampler(), Sampler())


@pytest.mark.parametrize(
    ("mode", "cutoff"), [("OPAQUE", 0.0), ("MASK", 0.25), ("MASK", None), ("BLEND", 0.0)]
)
def test_opacity(tmp_path: Path, mode: str, cutoff: float | None) -> None:
    """The factor multiplies the alpha channel of the color, which is linear."""
    pixels = np.random.default_rng(6).integers(0, 256, (3, 4, 4), dtype=np.uint8)
    pbr = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.8]}
    more: dict[str, Any] = {"alphaMode": mode}
    if mode == "MASK" and cutoff is not None:
        more["alphaCutoff"] = cutoff
    (material,) = quad(tmp_path, pbr, pixels, **more).materials
    if mode == "OPAQUE":
        assert not material.has_holes
        return
    assert material.opacity == pytest.approx(0.8)
    assert material.cutoff == (0.5 if cutoff is None else cutoff)
    assert material.opacity_texture is not None
    np.testing.assert_allclose(material.opacity_texture, pixels[..., 3] / 255, atol=1e-6)


def test_a_map_that_is_missing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="there is no texture 3"):
        quad(tmp_path, {"metallicRoughnessTexture": {"index": 3}}, noise(2, 2))


def sorted_uvs(mesh: Mesh) -> np.ndarray:
    """Return the texture coordinates of the corners in the order of `CORNERS`."""
    order = [int(np.abs(mesh.positions - corner).sum(axis=1).argmin()) for corner in CORNERS]
    return mesh.uvs[order]
