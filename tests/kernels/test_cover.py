"""cl/lib/world/cover.h, layers above a principled material: energy, tables, and maps below them.

`test_brdf.py` compares values and densities with the twin, and `test_brdf_sampling.py` samples.
"""

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.cover import clearcoat_reflectance, sheen_reflectance
from iprt.geometry.material import Material, material_table
from tests.kernels.brdf import call
from tests.kernels.wrap import evaluate
from tests.oracles import brdf as oracle

WHITE = (1.0, 1.0, 1.0)
SAMPLES = 1 << 17
MIRRORED = 2
ANGLES = [0, 30, 60, 80, 88]
MOST = 1.0 + 1e-3
"""Least upper bound of the light that a white material reflects; tables are interpolated."""
rng = np.random.default_rng(12)


def sampled_albedo(device: ComputeDevice, material: Material, angle: float) -> np.ndarray:
    """Return the (3,) share of light that is reflected, estimated as by the renderer."""
    o = oracle.direction(angle, 30)
    drawn = call(device, "sample", material, o, rng.random((SAMPLES, 3)))
    value = call(device, "eval", material, o, drawn["wi"])
    density = call(device, "pdf", material, o, drawn["wi"])["density"].sum(axis=1)
    albedo = (1.0 - material.metallic) * np.array(material.albedo)
    cosine = drawn["wi"][:, 2] / np.maximum(density, 1e-9)
    weight = (value["diffuse"][:, None] * albedo + value["specular"]) * cosine[:, None]
    weight[drawn["wi"][:, 2] <= 0.0] = 0.0
    mirrored = drawn["specular"] == MIRRORED
    weight[mirrored] = drawn["weight"][mirrored]
    return np.asarray(weight.mean(axis=0, dtype=np.float64))


def total(material: Material, angle: float) -> np.ndarray:
    return np.asarray(sum(oracle.covered_albedo(material, oracle.direction(angle, 30)).values()))


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("coat", [0.0, 0.01, 0.2, 1.0])
@pytest.mark.parametrize("alpha", [0.0, 0.1, 0.6])
def test_white_furnace_of_a_clearcoat(metallic: float, coat: float, alpha: float) -> None:
    """No more light is reflected than arrives. A smooth coat takes less than a tenth of it away."""
    bare = Material("principled", WHITE, alpha, metallic=metallic)
    for strength in (0.3, 1.0):
        material = replace(bare, clearcoat=strength, clearcoat_alpha=coat)
        for angle in ANGLES:
            reflected = total(material, angle)
            assert reflected.max() <= MOST
            if coat == 0.0:
                assert reflected.min() > total(bare, angle).min() - 0.1


@pytest.mark.parametrize("alpha", [0.0, 0.01, 0.05, 0.16, 0.36, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_white_furnace_of_sheen(alpha: float, metallic: float) -> None:
    for rough in (0.0, 0.5):
        material = Material("principled", WHITE, rough, metallic=metallic, sheen=WHITE)
        material = replace(material, sheen_alpha=alpha)
        for angle in ANGLES:
            assert total(material, angle).max() <= MOST


def test_white_furnace_of_both_and_of_a_tint() -> None:
    for coat in (0.0, 0.3):
        material = Material("principled", WHITE, 0.3, clearcoat=1.0, clearcoat_alpha=coat)
        material = replace(material, sheen=WHITE, tint=(1.0, 0.5, 0.0))
        for angle in ANGLES:
            assert total(material, angle).max() <= MOST


@pytest.mark.parametrize("angle", [0, 60, 85])
@pytest.mark.parametrize(
    "material",
    [
        Material("principled", (0.8, 0.5, 0.3), 0.3, clearcoat=1.0),
        Material("principled", (0.8, 0.5, 0.3), 0.0, clearcoat=0.7, clearcoat_alpha=0.2),
        Material("principled", (0.8, 0.5, 0.3), 0.4, metallic=1.0, clearcoat=1.0),
        Material("principled", (0.8, 0.5, 0.3), 0.0, metallic=1.0, clearcoat=1.0),
        Material("principled", (0.2, 0.1, 0.1), 0.5, sheen=(1.0, 0.6, 0.2), sheen_alpha=0.1),
        Material("principled", (0.8, 0.5, 0.3), 0.2, metallic=1.0, sheen=(0.1, 0.2, 0.3)),
    ],
    ids=["varnish", "wax", "car", "mirror", "velvet", "dusty metal"],
)
def test_sampling_reflects_what_the_lobes_integrate_to(
    device: ComputeDevice, material: Material, angle: float
) -> None:
    found = sampled_albedo(device, material, angle)
    np.testing.assert_allclose(found, total(material, angle), atol=0.01)


def test_weights_have_the_mean_of_their_lobes(device: ComputeDevice) -> None:
    """`BrdfSample.weight`, by which cones and mirrors scatter, without the sheen."""
    material = Material("principled", WHITE, 0.3, metallic=0.4, clearcoat=0.9, clearcoat_alpha=0.1)
    o = oracle.direction(50, 30)
    drawn = call(device, "sample", material, o, rng.random((SAMPLES, 3)))
    kept = np.where(drawn["specular"] != 0, 1.0, 1.0 - material.metallic)
    mean = (drawn["weight"][:, 0] * kept).mean()
    assert mean == pytest.approx(total(material, 50)[0], abs=0.01)


@pytest.mark.parametrize("angle", [0, 45, 85])
def test_the_density_is_of_no_more_than_all_samples(device: ComputeDevice, angle: float) -> None:
    material = Material("principled", WHITE, 0.4, clearcoat=1.0, clearcoat_alpha=0.2, sheen=WHITE)
    o = oracle.direction(angle, 0)
    i = rng.normal(size=(SAMPLES, 3))
    i /= np.linalg.norm(i, axis=1, keepdims=True)
    i[:, 2] = np.abs(i[:, 2])
    density = call(device, "pdf", material, o, i)["density"].sum(axis=1)
    assert density.mean() * 2 * np.pi <= 1.01


def test_the_tables_are_the_integrals_of_their_lobes() -> None:
    cosine = np.array([0.003, 0.1, 0.4, 1.0])
    directions = [oracle.direction(float(np.degrees(np.arccos(c)))) for c in cosine]
    for alpha in (0.05, 0.3, 1.0):
        plastic = Material("plastic", WHITE, alpha, 1.5)
        expected = [oracle.specular_albedo(plastic, o)[0] for o in directions]
        np.testing.assert_allclose(clearcoat_reflectance(cosine, alpha), expected, atol=2e-3)
    assert clearcoat_reflectance(cosine, 0.0) == pytest.approx(oracle.fresnel(cosine, 1.5))
    for alpha in (0.36, 1.0):  # below, sheen is limited
        velvet = Material("principled", sheen=WHITE, sheen_alpha=alpha)
        expected = [oracle.covered_albedo(velvet, o)["sheen"][0] for o in directions]
        np.testing.assert_allclose(sheen_reflectance(cosine, alpha), expected, atol=2e-3)


def test_sheen_colors_edges(device: ComputeDevice) -> None:
    """Where it is seen at grazing angles, velvet has the color of the sheen."""
    velvet = Material("principled", (0.01, 0.01, 0.05), 1.0, sheen=(0.9, 0.1, 0.1))
    straight, grazing = (sampled_albedo(device, velvet, angle) for angle in (0, 85))
    assert grazing[0] > 4.0 * grazing[2]
    assert grazing[0] > 4.0 * straight[0]


def test_a_clearcoat_reflects_as_a_smooth_dielectric(device: ComputeDevice) -> None:
    """Above black of little reflectance, it is all that is seen."""
    black = Material("principled", (0.0, 0.0, 0.0), 0.5, 1.001, clearcoat=0.5)
    for angle in (0, 70):
        o = oracle.direction(angle, 0)
        drawn = call(device, "sample", black, o, rng.random((SAMPLES, 3)))
        mirrored = drawn["specular"] == MIRRORED
        expected = np.tile(o * [-1, -1, 1], (mirrored.sum(), 1))
        np.testing.assert_allclose(drawn["wi"][mirrored], expected, atol=1e-6)
        mean = drawn["weight"][mirrored, 0].sum() / SAMPLES
        assert mean == pytest.approx(0.5 * oracle.fresnel(o[2], 1.5), rel=0.02)


def test_other_materials_of_the_same_scene_are_as_without(device: ComputeDevice) -> None:
    """Kernels with covers evaluate materials without them."""
    i = oracle.normalized(np.abs(rng.normal(size=(2000, 3))))
    for kind in ("diffuse", "conductor", "plastic", "principled"):
        metallic = 0.4 if kind == "principled" else 0.0
        material = Material(kind, (0.8, 0.5, 0.3), 0.2, metallic=metallic)
        found = _covered(device, material, i, (metallic, 0.2))
        expected = call(device, "eval", material, oracle.direction(50, 0), i)
        for lobe in ("diffuse", "specular"):
            np.testing.assert_allclose(found[lobe], expected[lobe], rtol=1e-6)


def test_a_map_of_roughness_keeps_the_cover(device: ComputeDevice) -> None:
    material = Material("principled", (0.8, 0.5, 0.3), 0.25, metallic=0.4, clearcoat=0.8)
    material = replace(material, clearcoat_alpha=0.1, sheen=(0.2, 0.1, 0.0))
    image = np.ones((1, 1, 2), np.float32)
    mapped = replace(material, alpha=1.0, metallic=1.0, surface_texture=image)
    i = oracle.normalized(np.abs(rng.normal(size=(2000, 3))))
    found = _covered(device, mapped, i, (0.4, 0.25))
    expected = call(device, "eval", material, oracle.direction(50, 0), i)
    np.testing.assert_allclose(found["specular"], expected["specular"], rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(found["diffuse"], expected["diffuse"], rtol=4e-3)


def _covered(
    device: ComputeDevice, material: Material, i: np.ndarray, finish: tuple[float, float]
) -> dict[str, np.ndarray]:
    """Return what brdf_eval() of a material returns in a kernel with covers."""
    body = """
        const Material m = load_surface_material(materials, 0, finish);
        const BrdfValue v = brdf_eval(m, albedo, (float3)(0.0f, 0.0f, 1.0f), wo, wi);
        diffuse = v.diffuse; specular = v.specular;
    """
    inputs = {
        "albedo": np.tile(np.float32(material.albedo), (len(i), 1)),
        "wo": np.tile(np.float32(oracle.direction(50, 0)), (len(i), 1)),
        "wi": np.float32(i),
        "finish": np.tile(np.float32(finish), (len(i), 1)),
    }
    return evaluate(
        device,
        ["world/brdf.h"],
        body,
        inputs,
        {"diffuse": "float", "specular": "float3"},
        {"materials": material_table([material])},
        ("PRINCIPLED", "COVERED"),
    )
