"""cl/lib/world/brdf.h: values against float64 twins, energy, reciprocity, extremes, variants."""

from dataclasses import replace

import numpy as np
import pytest

from iprt.geometry.coat import rough_transmittance
from iprt.geometry.material import Material
from tests.kernels.brdf import call, grid
from tests.oracles import brdf as oracle

WHITE = (1.0, 1.0, 1.0)
DIFFUSE = Material("diffuse", (0.6, 0.3, 0.2))
MATERIALS = [
    DIFFUSE,
    Material("conductor", (0.9, 0.8, 0.6), 0.1),
    Material("conductor", (0.9, 0.8, 0.6), 0.5),
    Material("plastic", (0.5, 0.1, 0.2), 0.1, 1.5),
    Material("plastic", (0.0, 0.0, 0.0), 0.3, 1.8),
    Material("plastic", (0.5, 0.1, 0.2), 0.0, 1.5),
    Material("principled", (0.5, 0.1, 0.2), 0.3, 1.5, metallic=0.0),
    Material("principled", (0.9, 0.6, 0.2), 0.1, 1.8, metallic=0.4),
    Material("principled", (0.9, 0.6, 0.2), 0.2, metallic=1.0),
]
COVERED = [
    Material("principled", (0.5, 0.1, 0.2), 0.3, clearcoat=0.8, clearcoat_alpha=0.0),
    Material("principled", (0.9, 0.6, 0.2), 0.4, metallic=0.7, clearcoat=1.0, clearcoat_alpha=0.1),
    Material("principled", (0.3, 0.1, 0.1), 0.5, sheen=(0.9, 0.5, 0.1), sheen_alpha=0.16),
    Material("principled", (0.3, 0.1, 0.1), 0.0, sheen=(1.0, 0.5, 0.1), sheen_alpha=0.01),
    Material(
        "principled",
        (0.9, 0.6, 0.2),
        0.2,
        metallic=1.0,
        clearcoat=0.5,
        clearcoat_alpha=0.3,
        sheen=(0.2, 0.4, 0.3),
    ),
    Material("principled", (0.2, 0.2, 0.2), 0.3, 1.9, metallic=0.2, tint=(1.0, 0.4, 0.0)),
]
rng = np.random.default_rng(7)


def hemisphere(count, least=0.02):
    z = rng.uniform(least, 1, count)
    phi = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)


def near_mirror(o, alpha, count):
    """Directions where a lobe of this roughness has its weight."""
    h = oracle.normalized(np.array([0, 0, 1]) + alpha * rng.normal(size=(count, 3)))
    i = 2 * (h @ o)[:, None] * h - o
    return i[i[:, 2] > 0.02]


@pytest.mark.parametrize("material", MATERIALS + COVERED)
@pytest.mark.parametrize("angle", [0, 30, 75])
def test_values_and_densities_equal_the_twin(device, material, angle):
    o = oracle.direction(angle, 40)
    lobe = near_mirror(o, max(material.alpha, 1e-3), 500)
    i = np.concatenate([hemisphere(500), lobe]).astype(np.float32).astype(np.float64)
    value = call(device, "eval", material, o, i)
    pdf = call(device, "pdf", material, o, i)["density"]
    expected = oracle.evaluate_diffuse(material, np.broadcast_to(o, i.shape), i)
    np.testing.assert_allclose(value["diffuse"], expected, 2e-5, 1e-7)
    np.testing.assert_allclose(pdf, oracle.density(material, o, i), 2e-4, 1e-6)
    expected = np.zeros_like(i)
    if material.kind != "diffuse":
        expected = oracle.evaluate_specular(material, o, i)
    np.testing.assert_allclose(value["specular"], expected, 2e-4, 1e-6)


def test_the_least_roughness_is_evaluated_accurately(device):
    material = Material("conductor", WHITE, 1e-3)
    o = oracle.direction(50, 20).astype(np.float32).astype(np.float64)
    i = near_mirror(o, 1e-3, 2000).astype(np.float32).astype(np.float64)
    value = call(device, "eval", material, o, i)["specular"][:, 0]
    expected = oracle.evaluate_specular(material, o, i)[:, 0]
    strong = expected > expected.max() * 1e-3
    np.testing.assert_allclose(value[strong], expected[strong], rtol=5e-3)


@pytest.mark.parametrize("material", MATERIALS + COVERED)
def test_reflectance_is_reciprocal(device, material):
    a, b = hemisphere(4000, 0.01), hemisphere(4000, 0.01)
    forth, back = call(device, "eval", material, a, b), call(device, "eval", material, b, a)
    for lobe in ("diffuse", "specular"):
        scale = np.maximum(1, np.abs(forth[lobe]))
        assert np.max(np.abs(forth[lobe] - back[lobe]) / scale) < 1e-5


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("angle", [10, 80])
def test_weights_are_value_times_cosine_over_density(device, material, angle):
    normal = oracle.normalized(np.array([0.3, -0.5, -0.8]))
    tangent = oracle.normalized(np.cross(normal, [1, 0, 0]))
    o = np.cos(np.radians(angle)) * normal + np.sin(np.radians(angle)) * tangent
    drawn = call(device, "sample", material, o, rng.random((4000, 3)), normal)
    np.testing.assert_allclose(np.linalg.norm(drawn["wi"], axis=1), 1, atol=1e-5)
    cosine = drawn["wi"] @ normal
    value = call(device, "eval", material, o, drawn["wi"], normal)
    density = call(device, "pdf", material, o, drawn["wi"], normal)["density"]
    specular = drawn["specular"] != 0
    diffuse = ~specular & (cosine > 0.01)
    np.testing.assert_allclose(
        drawn["weight"][diffuse],
        np.tile((value["diffuse"] * cosine)[diffuse, None] / density[diffuse, :1], (1, 3)),
        rtol=1e-3,
    )
    if material.alpha > 0:
        glossy = specular & (cosine > 0.01)
        expected = value["specular"] * (cosine / np.maximum(density[:, 1], 1e-9))[:, None]
        np.testing.assert_allclose(drawn["weight"][glossy], expected[glossy], rtol=5e-3)


@pytest.mark.parametrize("alpha", [0.0, 1e-4, 0.01, 0.5, 1.0])
@pytest.mark.parametrize("angle", [0, 30, 60, 85])
def test_white_furnace_of_a_conductor(device, alpha, angle):
    material = Material("conductor", WHITE, alpha)
    o = oracle.direction(angle, 15)
    weight = call(device, "sample", material, o, grid(256))["weight"]
    assert weight.max() <= 1 + 1e-6
    mean = weight.astype(np.float64).mean(axis=0)
    if alpha == 0:
        np.testing.assert_array_equal(weight, 1)
    else:
        np.testing.assert_allclose(mean, oracle.specular_albedo(material, o), rtol=2e-3)


@pytest.mark.parametrize("alpha", [0.0, 0.05, 0.2, 1.0])
@pytest.mark.parametrize("angle", [0, 60, 80, 88])
def test_plastic_reflects_what_its_lobes_integrate_to_and_never_more_than_arrives(
    device, alpha, angle
):
    material = Material("plastic", WHITE, alpha, 1.5)
    o = oracle.direction(angle, 100)
    drawn = call(device, "sample", material, o, grid(64, 64))
    specular = drawn["specular"] != 0
    mean = [
        drawn["weight"][lobe, 0].sum(dtype=float) / len(specular) for lobe in (~specular, specular)
    ]
    expected = oracle.fresnel(o[2], 1.5)
    if alpha > 0:
        expected = oracle.specular_albedo(material, o)[0]
    # The choice of the lobe is quantized to 1/64 here.
    p = oracle.specular_probability(material, o)
    quantized = np.mean((np.arange(64) + 0.5) / 64 < p)
    np.testing.assert_allclose(mean[1] * p / quantized, expected, rtol=4e-3)
    np.testing.assert_allclose(
        mean[0] * (1 - p) / (1 - quantized), oracle.diffuse_albedo(material, o), rtol=2e-3
    )
    # A smooth white coat and base reflect all: 1e-3 is the error of the table's interpolation.
    assert oracle.diffuse_albedo(material, o) + expected <= 1 + 1e-3


def test_the_coat_table_interpolates_the_integral():
    cosine = np.linspace(0.02, 1, 300)
    for alpha in (0.0, 0.02, 0.1, 0.5):
        material = Material("plastic", WHITE, alpha, 1.5)
        exact = rough_transmittance(cosine, alpha, 1.5)
        np.testing.assert_allclose(oracle.transmittance(material, cosine), exact, atol=2e-3)


@pytest.mark.parametrize("kind", ["diffuse", "conductor", "plastic", "principled"])
@pytest.mark.parametrize("ior", [1.0, 1.5, 3.0])
def test_extreme_inputs_stay_finite(device, kind, ior):
    cosines = np.float64([1, 0.5, 1e-3, 1e-7, 0, -1e-3, -0.3, -1])
    corners = [0, 2**-24, 0.5, 1 - 2**-24]
    planes = [([0, 0, 1], [1, 0, 0]), ([0, 0, -1], [0, 1, 0]), ([0, 1, 0], [0, 0, 1])]
    u = np.stack(np.meshgrid(corners, corners, corners, cosines, [0, 1, 2]), -1).reshape(-1, 5)
    n, tangent = np.array(planes)[u[:, 4].astype(int)].transpose(1, 0, 2)
    wo = u[:, 3:4] * n + np.sqrt(1 - u[:, 3:4] ** 2) * tangent
    for alpha in (0.0, 1e-5, 1e-4, 1e-3, 0.01, 0.5, 1.0):
        material = Material(kind, WHITE, alpha, ior, metallic=0.5)
        if kind == "principled":
            material = replace(
                material, clearcoat=1.0, clearcoat_alpha=alpha, sheen=WHITE, sheen_alpha=alpha
            )
        drawn = call(device, "sample", material, wo, u[:, :3], n)
        assert np.all(np.isfinite(drawn["weight"]))
        assert drawn["weight"].min() >= 0
        np.testing.assert_allclose(np.linalg.norm(drawn["wi"], axis=1), 1, atol=1e-4)
        lit = drawn["weight"].max(axis=1) > 0
        assert np.all(np.sum(drawn["wi"] * n, axis=1)[lit] > 0)
        value = call(device, "eval", material, wo, drawn["wi"], n)
        density = call(device, "pdf", material, wo, drawn["wi"], n)
        assert all(np.all(np.isfinite(v)) for v in (*value.values(), *density.values()))


def test_a_mirror_reflects_about_the_normal(device):
    material = Material("conductor", (0.9, 0.8, 0.7), 0.0)
    o = hemisphere(1000)
    drawn = call(device, "sample", material, o, rng.random((1000, 3)))
    np.testing.assert_allclose(drawn["wi"], o * [-1, -1, 1], atol=1e-6)
    np.testing.assert_allclose(drawn["weight"], np.tile([0.9, 0.8, 0.7], (1000, 1)), rtol=1e-6)
    assert np.all(drawn["specular"] == 1)
