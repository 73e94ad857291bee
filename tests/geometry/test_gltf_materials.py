"""Metallic-roughness materials of glTF: maps, and how textures are placed."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from iprt.errors import FormatError
from iprt.geometry.material import MAX_ABSORPTION, MAX_EMISSION, Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.meshes import load_mesh
from iprt.geometry.sampler import Sampler
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


def test_samplers(tmp_path: Path) -> None:
    pbr = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}
    samplers = [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}, {"magFilter": 9729}]
    mesh = quad(
        tmp_path,
        pbr,
        noise(2, 2),
        noise(2, 2),
        samplers=samplers,
        emissiveFactor=[1, 1, 1],
        emissiveTexture={"index": 0},
    )
    (material,) = mesh.materials
    clamped = Sampler(("clamp", "mirror"), nearest=True)
    assert material.samplers == (clamped, Sampler(), Sampler(), clamped, Sampler())


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


def test_emission(tmp_path: Path) -> None:
    """Its texture is a color; the extension multiplies its factor."""
    stored = noise(3, 2)
    mesh = quad(
        tmp_path,
        {},
        stored,
        emissiveFactor=[1.0, 0.5, 0.25],
        emissiveTexture={"index": 0},
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 40.0}},
    )
    (material,) = mesh.materials
    assert material.emission == pytest.approx((40.0, 20.0, 10.0))
    assert material.emission_texture is not None
    linear = np.where(stored > 10, ((stored / 255 + 0.055) / 1.055) ** 2.4, stored / 255 / 12.92)
    np.testing.assert_allclose(material.emission_texture, linear, atol=1e-3)
    np.testing.assert_allclose(sorted_uvs(mesh), UVS * [1, -1] + [0, 1], atol=1e-6)
    assert mesh.dropped == ()


@pytest.mark.parametrize("strength", [-1.0, 1e30])
def test_emission_is_bounded(tmp_path: Path, strength: float) -> None:
    mesh = quad(
        tmp_path,
        {},
        emissiveFactor=[1.0, 0.0, 0.0],
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": strength}},
    )
    (material,) = mesh.materials
    assert material.emission == ((0.0 if strength < 0.0 else MAX_EMISSION), 0.0, 0.0)


def test_a_map_without_a_factor_emits_nothing(tmp_path: Path) -> None:
    (material,) = quad(tmp_path, {}, noise(2, 2), emissiveTexture={"index": 0}).materials
    assert not material.emits
    assert not material.textured


def extended(folder: Path, name: str, values: dict[str, Any], **pbr: Any) -> Mesh:
    """Load a plastic square with a KHR_materials extension."""
    given = {"metallicFactor": 0.0, "roughnessFactor": 0.5, **pbr}
    return quad(folder, given, extensions={f"KHR_materials_{name}": values})


@pytest.mark.parametrize(("given", "ior"), [(1.2, 1.2), (1.5, 1.5), (9.0, 4.0), (0.0, 4.0)])
def test_the_index_of_refraction(tmp_path: Path, given: float, ior: float) -> None:
    """The largest stands for larger ones, and for 0, which means that all is reflected."""
    (material,) = extended(tmp_path, "ior", {"ior": given}).materials
    assert (material.kind, material.ior) == ("plastic", ior)


@pytest.mark.parametrize("factor", [0.25, 1.0, 2.0])
def test_specular_multiplies_the_reflectance_at_normal_incidence(
    tmp_path: Path, factor: float
) -> None:
    mesh = extended(tmp_path, "specular", {"specularFactor": factor})
    (material,) = mesh.materials
    reflectance = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
    assert reflectance == pytest.approx(0.04 * factor)
    assert mesh.dropped == ()


@pytest.mark.parametrize(
    ("name", "values"), [("ior", {"ior": 1.0}), ("specular", {"specularFactor": 0.0})]
)
def test_without_a_reflection_it_is_diffuse(
    tmp_path: Path, name: str, values: dict[str, Any]
) -> None:
    (material,) = extended(tmp_path, name, values).materials
    assert material.kind == "diffuse"


def test_a_colored_reflection_is_a_tint(tmp_path: Path) -> None:
    """The greatest channel gives the index of refraction."""
    mesh = extended(tmp_path, "specular", {"specularColorFactor": [2.0, 1.0, 0.0]})
    (material,) = mesh.materials
    assert (material.kind, material.tint) == ("principled", (1.0, 0.5, 0.0))
    reflectance = ((material.ior - 1.0) / (material.ior + 1.0)) ** 2
    assert reflectance == pytest.approx(0.08)
    assert mesh.dropped == ()


def test_unlit_shows_its_color(tmp_path: Path) -> None:
    """It reflects nothing, whatever else the material has."""
    stored = noise(2, 3)
    pbr = {"baseColorFactor": [0.5, 0.2, 1.0, 1.0], "baseColorTexture": {"index": 0}}
    mesh = quad(tmp_path, pbr, stored, extensions={"KHR_materials_unlit": {}})
    (material,) = mesh.materials
    assert (material.kind, material.albedo) == ("diffuse", (0.0, 0.0, 0.0))
    assert material.emission == (0.5, 0.2, 1.0)
    assert material.emission_texture is not None
    assert material.emission_texture.shape == (2, 3, 3)
    assert material.texture is None
    assert mesh.dropped == ()


def test_holes_of_unlit_surfaces(tmp_path: Path) -> None:
    pixels = np.random.default_rng(6).integers(0, 256, (3, 4, 4), dtype=np.uint8)
    pbr = {"baseColorTexture": {"index": 0}}
    mesh = quad(tmp_path, pbr, pixels, extensions={"KHR_materials_unlit": {}}, alphaMode="MASK")
    (material,) = mesh.materials
    assert material.emits
    assert material.opacity_texture is not None
    assert material.texture is not None
    assert material.opacity_texture.shape == material.texture.shape[:2]


# Transmission --------------------------------------------------------------------------------


def transmitting(
    folder: Path, transmission: dict[str, Any], volume: dict[str, Any] | None = None
) -> Mesh:
    """Load a square with `transmission`, a `volume` or none, and an index of refraction of 1.4."""
    given: dict[str, Any] = {"transmission": transmission, "ior": {"ior": 1.4}}
    if volume is not None:
        given["volume"] = volume
    pbr = {"baseColorFactor": [0.9, 0.8, 0.7, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.3}
    return quad(folder, pbr, extensions={f"KHR_materials_{name}": v for name, v in given.items()})


def test_transmission_without_a_volume_is_a_thin_wall(tmp_path: Path) -> None:
    mesh = transmitting(tmp_path, {"transmissionFactor": 1.0})
    (material,) = mesh.materials
    assert (material.kind, material.ior, material.thin) == ("dielectric", 1.4, True)
    assert material.albedo == pytest.approx((0.9, 0.8, 0.7))
    assert material.alpha == pytest.approx(0.09)
    assert (mesh.dropped, mesh.warnings) == ((), ())


def test_a_share_of_the_light_passes_a_principled_material(tmp_path: Path) -> None:
    (material,) = transmitting(tmp_path, {"transmissionFactor": 0.4}).materials
    assert (material.kind, material.transmission) == ("principled", 0.4)
    assert material.transmits


def test_no_transmission_is_plastic(tmp_path: Path) -> None:
    (material,) = transmitting(tmp_path, {"transmissionFactor": 0.0}).materials
    assert (material.kind, material.transmits) == ("plastic", False)


def test_a_volume_absorbs(tmp_path: Path) -> None:
    """After the attenuation distance, light has the attenuation color."""
    color = np.array([0.2, 0.5, 1.0])
    volume = {
        "thicknessFactor": 0.01,
        "attenuationDistance": 0.05,
        "attenuationColor": color.tolist(),
    }
    mesh = transmitting(tmp_path, {"transmissionFactor": 1.0}, volume)
    (material,) = mesh.materials
    np.testing.assert_allclose(np.exp(-np.array(material.absorption) * 0.05), color, rtol=1e-6)
    # A square is no solid: it remains a pane.
    assert material.thin
    assert "open" in mesh.warnings[0]


@pytest.mark.parametrize("distance", [0.0, -1.0, 1e-30])
def test_absorption_is_bounded(tmp_path: Path, distance: float) -> None:
    volume = {"thicknessFactor": 1, "attenuationDistance": distance, "attenuationColor": [0, 0, 0]}
    (material,) = transmitting(tmp_path, {"transmissionFactor": 1.0}, volume).materials
    assert 0.0 < max(material.absorption) <= MAX_ABSORPTION


def test_a_map_of_transmission(tmp_path: Path) -> None:
    """Glass whose map lets less pass is principled; red counts."""
    stored = np.zeros((1, 2, 3), np.uint8)
    stored[0, 1] = 255, 128, 64
    given = {"transmissionFactor": 1.0, "transmissionTexture": {"index": 0}}
    extensions = {"KHR_materials_transmission": given}
    mesh = quad(tmp_path, {"metallicFactor": 0.0}, stored, extensions=extensions)
    (material,) = mesh.materials
    assert (material.kind, material.transmission, material.thin) == ("principled", 0.5, True)
    assert [one.transmission for one in material.palette] == [0.0, 1.0]
    assert mesh.dropped == ()
