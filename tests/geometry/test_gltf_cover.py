"""KHR_materials_clearcoat and KHR_materials_sheen of glTF files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt.errors import FormatError
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Mesh
from tests.geometry.test_gltf_materials import noise, quad


def covered(
    folder: Path, pbr: dict[str, Any] | None = None, *images: np.ndarray, **given: Any
) -> Mesh:
    """Load a square with extensions; without `pbr` it is plastic of roughness 0.5."""
    pbr = {"metallicFactor": 0.0, "roughnessFactor": 0.5} if pbr is None else pbr
    extensions = {f"KHR_materials_{name}": values for name, values in given.items()}
    return quad(folder, pbr, *images, extensions=extensions)


def linear(stored: np.ndarray) -> np.ndarray:
    return np.where(stored > 10, ((stored / 255 + 0.055) / 1.055) ** 2.4, stored / 255 / 12.92)


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
def test_a_clearcoat(tmp_path: Path, metallic: float) -> None:
    pbr = {"metallicFactor": metallic, "roughnessFactor": 0.5}
    given = {"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.2}
    mesh = covered(tmp_path, pbr, clearcoat=given)
    (material,) = mesh.materials
    assert (material.kind, material.metallic) == ("principled", metallic)
    assert (material.alpha, material.clearcoat) == (0.25, 0.75)
    assert material.clearcoat_alpha == pytest.approx(0.04)
    assert max(material.sheen) == 0.0
    assert (mesh.dropped, mesh.warnings) == ((), ())


def test_sheen(tmp_path: Path) -> None:
    """A dull surface below it keeps its coat, too."""
    given = {"sheenColorFactor": [0.5, 0.25, 0.0], "sheenRoughnessFactor": 0.3}
    mesh = covered(tmp_path, {"metallicFactor": 0.0, "roughnessFactor": 1.0}, sheen=given)
    (material,) = mesh.materials
    assert (material.kind, material.alpha) == ("principled", 1.0)
    assert material.sheen == (0.5, 0.25, 0.0)
    assert material.sheen_alpha == pytest.approx(0.09)
    assert mesh.dropped == ()


@pytest.mark.parametrize(
    "given",
    [
        {"clearcoat": {"clearcoatRoughnessFactor": 0.5}},
        {"clearcoat": {"clearcoatFactor": -1.0}},
        {"sheen": {"sheenRoughnessFactor": 0.5}},
        {"clearcoat": {}, "sheen": {}},
    ],
)
def test_without_a_strength_nothing_is_covered(tmp_path: Path, given: dict[str, Any]) -> None:
    (material,) = covered(tmp_path, **given).materials
    assert material.kind == "plastic"


def test_impossible_strengths_are_bounded(tmp_path: Path) -> None:
    coat = {"clearcoatFactor": 7.0, "clearcoatRoughnessFactor": 3.0}
    sheen = {"sheenColorFactor": [-1.0, 9.0, 0.5], "sheenRoughnessFactor": -2.0}
    (material,) = covered(tmp_path, clearcoat=coat, sheen=sheen).materials
    assert (material.clearcoat, material.clearcoat_alpha) == (1.0, 1.0)
    assert (material.sheen, material.sheen_alpha) == ((0.0, 1.0, 0.5), 0.0)


def test_maps_of_two_layers_share_their_texels(tmp_path: Path) -> None:
    """Red is the strength, green the roughness; sheen's roughness is alpha, its color sRGB."""
    first, second = noise(3, 5), np.random.default_rng(6).integers(0, 256, (3, 5, 4), np.uint8)
    coat = {
        "clearcoatFactor": 0.8,
        "clearcoatTexture": {"index": 0},
        "clearcoatRoughnessFactor": 0.5,
        "clearcoatRoughnessTexture": {"index": 0},
    }
    sheen = {
        "sheenColorFactor": [1.0, 0.5, 0.25],
        "sheenColorTexture": {"index": 1},
        "sheenRoughnessFactor": 0.6,
        "sheenRoughnessTexture": {"index": 1},
    }
    mesh = covered(tmp_path, None, first, second, clearcoat=coat, sheen=sheen)
    (material,) = mesh.materials
    assert mesh.dropped == ()
    assert material.maps == (None,) * 5
    expected = {
        "clearcoat": 0.8 * first[..., 0] / 255,
        "clearcoat_alpha": 0.25 * (first[..., 1] / 255) ** 2,
        "sheen": linear(second[..., :3]) * [1.0, 0.5, 0.25],
        "sheen_alpha": 0.36 * (second[..., 3] / 255) ** 2,
    }
    assert material.variants is not None
    for name, values in expected.items():
        palette = np.array([getattr(variant, name) for variant in material.palette])
        np.testing.assert_allclose(palette[material.variants.index], values, atol=1e-4)
        assert getattr(material, name) == pytest.approx(values.mean(axis=(0, 1)), abs=1e-4)


def test_a_smaller_map_is_enlarged(tmp_path: Path) -> None:
    """Its texels lie where they did, and values between them are between theirs."""
    coarse = np.zeros((1, 2, 3), np.uint8)
    coarse[0, 1] = 255
    fine = np.full((4, 8, 3), 255, np.uint8)
    coat = {
        "clearcoatFactor": 1.0,
        "clearcoatTexture": {"index": 0},
        "clearcoatRoughnessFactor": 1.0,
        "clearcoatRoughnessTexture": {"index": 1},
    }
    (material,) = covered(tmp_path, None, coarse, fine, clearcoat=coat).materials
    assert material.variants is not None
    palette = np.array([variant.clearcoat for variant in material.palette])
    found = palette[material.variants.index]
    assert found.shape == (4, 8)
    expected = np.clip((np.arange(8) + 0.5) / 4 - 0.5, 0.0, 1.0)
    np.testing.assert_allclose(found, np.tile(expected, (4, 1)), atol=0.01)


def test_maps_without_effect_are_not_read(tmp_path: Path) -> None:
    """Of a metal, specular strength; of a factor of 0, everything."""
    pbr = {"metallicFactor": 1.0, "roughnessFactor": 0.5}
    given = {
        "specular": {"specularTexture": {"index": 0}},
        "clearcoat": {"clearcoatFactor": 0.0, "clearcoatTexture": {"index": 9}},
        "sheen": {"sheenColorFactor": [0.0] * 3, "sheenColorTexture": {"index": 9}},
    }
    alpha = np.dstack([noise(2, 2), [[0, 64], [128, 255]]]).astype(np.uint8)
    mesh = covered(tmp_path, pbr, alpha, **given)
    (material,) = mesh.materials
    assert (material.variants, mesh.dropped) == (None, ())


def test_a_normal_map_of_clearcoat(tmp_path: Path) -> None:
    """It has a scale of its own, and needs tangents, also where nothing else does."""
    pixels = noise(2, 3)
    given = {"clearcoatFactor": 1.0, "clearcoatNormalTexture": {"index": 0, "scale": 0.5}}
    mesh = covered(tmp_path, None, pixels, clearcoat=given)
    (material,) = mesh.materials
    assert (mesh.dropped, mesh.warnings) == ((), ())
    assert mesh.tangents is not None
    expected = pixels[..., :3] / 127.5 - 1.0
    expected[..., :2] *= 0.5
    found = material.clearcoat_normal_texture
    assert found is not None
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert (material.normal_texture, material.variants) == (None, None)
    assert MaterialNeeds.of([material]).coat_normals
    assert material.maps[4] is found


@pytest.mark.parametrize("factor", [0.0, 1.0])
def test_a_clearcoat_without_a_normal_map(tmp_path: Path, factor: float) -> None:
    """Nothing bends it; of one without strength, no map is read."""
    coat = {"clearcoatFactor": factor}
    if factor == 0.0:
        coat["clearcoatNormalTexture"] = {"index": 9}
    mesh = covered(tmp_path, None, noise(2, 3), clearcoat=coat)
    (material,) = mesh.materials
    assert material.clearcoat_normal_texture is None
    assert not MaterialNeeds.of([material]).coat_normals
    bumpy = replace(material, normal_texture=np.zeros((1, 1, 3), np.float32))
    assert MaterialNeeds.of([bumpy]).coat_normals == (factor > 0.0)


def test_a_missing_texture_is_an_error(tmp_path: Path) -> None:
    given = {"clearcoatFactor": 1.0, "clearcoatTexture": {"index": 3}}
    with pytest.raises(FormatError, match="there is no texture 3"):
        covered(tmp_path, clearcoat=given)


def test_glass_has_no_cover(tmp_path: Path) -> None:
    given = {
        "transmission": {"transmissionFactor": 1.0},
        "clearcoat": {"clearcoatFactor": 1.0},
        "sheen": {"sheenColorFactor": [1.0, 1.0, 1.0]},
        "specular": {
            "specularColorFactor": [1.0, 0.0, 0.0],
            "specularColorTexture": {"index": 0},
        },
    }
    mesh = covered(tmp_path, None, noise(2, 2), **given)
    (material,) = mesh.materials
    assert material.kind == "dielectric"
    assert mesh.dropped == (
        "clearcoat of glass",
        "sheen of glass",
        "color of the specular reflection of glass",
        "map of specular strength of glass; its mean is used",
    )


def test_unlit_has_no_cover(tmp_path: Path) -> None:
    (material,) = covered(tmp_path, unlit={}, clearcoat={"clearcoatFactor": 1.0}).materials
    assert not material.is_covered
