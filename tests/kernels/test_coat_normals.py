"""Clearcoats with a normal of their own: -D COAT_NORMALS of cl/lib/world/brdf.h and finish.h.

The twins and `test_brdf_sampling.py` have them too.
"""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from tests.kernels.brdf import call, grid
from tests.kernels.test_brdf import COVERED
from tests.kernels.wrap import evaluate
from tests.oracles import brdf as oracle

WHITE = (1.0, 1.0, 1.0)
MIRRORED = 2
MOST = 1.0 + 1e-3
"""Least upper bound of the light that a white material reflects; tables are interpolated."""
TILTS = [(0.0, 0.0), (20.0, 130.0), (50.0, 30.0)]
"""Polar and azimuth angle of the clearcoat's normal."""
MATERIALS = [material for material in COVERED if material.clearcoat > 0.0]
rng = np.random.default_rng(3)


def sphere(count: int) -> np.ndarray:
    return oracle.normalized(rng.normal(size=(count, 3))).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("angle", [0, 40, 78])
def test_values_and_densities_equal_the_twin(
    device: ComputeDevice, material: Material, angle: float, tilt: tuple[float, float]
) -> None:
    """Above the plane of the shading normal and below."""
    coat, o = oracle.direction(*tilt), oracle.direction(angle, 40)
    lobe = oracle.normalized(coat + 0.3 * rng.normal(size=(2000, 3)))
    i = np.concatenate([sphere(2000), 2 * (lobe @ o)[:, None] * lobe - o])
    i = i.astype(np.float32).astype(float)
    clear = [np.abs(v @ normal) > 0.02 for v in (i, i + o) for normal in (coat, oracle.Z)]
    i = i[np.all(clear, axis=0)]
    o = np.float64(np.float32(o))
    found = call(device, "eval", material, o, i, coat=coat)
    above = np.where(i[:, 2:] > 0, i, oracle.Z)
    expected = oracle.evaluate_diffuse(material, np.broadcast_to(o, i.shape), above, coat)
    np.testing.assert_allclose(found["diffuse"], np.where(i[:, 2] > 0, expected, 0), 2e-5, 1e-7)
    expected = oracle.evaluate_specular(material, o, above, coat=coat)
    below = oracle.clearcoat(material, o, i, coat)[:, None]
    expected = np.where(i[:, 2:] > 0, expected, below)
    np.testing.assert_allclose(found["specular"], expected, 5e-4, 1e-6)
    density = call(device, "pdf", material, o, i, coat=coat)["density"]
    np.testing.assert_allclose(density, oracle.density(material, o, i, coat), 1e-3, 1e-6)


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("alpha", [0.0, 0.05, 0.3, 1.0])
@pytest.mark.parametrize("angle", [0, 40, 75])
def test_white_furnace(
    device: ComputeDevice, alpha: float, angle: float, tilt: tuple[float, float]
) -> None:
    """No more light is reflected than arrives, and samples find what the lobes integrate to."""
    coat, o = oracle.direction(*tilt), oracle.direction(angle, 100)
    for rough, metallic in ((0.0, 1.0), (0.0, 0.0), (0.3, 1.0), (0.5, 0.3)):
        material = Material("principled", WHITE, rough, metallic=metallic, clearcoat=1.0)
        material = material.edited(clearcoat_alpha=alpha)
        drawn = call(device, "sample", material, o, grid(48, 48), coat=coat)
        reflected = weights(device, material, o, coat, drawn)
        # The choice of the lobe is quantized to 1/48.
        mean, error = reflected.mean(), reflected.std() / np.sqrt(len(reflected)) + 0.004
        assert mean <= MOST + 3 * error
        kept = np.where(drawn["specular"] != 0, 1.0, 1.0 - metallic)
        assert (drawn["weight"][:, 0] * kept).mean() == pytest.approx(mean, abs=5 * error)


def weights(
    device: ComputeDevice, material: Material, o: np.ndarray, coat: np.ndarray, drawn: dict
) -> np.ndarray:
    """f cos over the density of samples, as the renderer computes it from the values."""
    i = drawn["wi"]
    value = call(device, "eval", material, o, i, coat=coat)
    density = call(device, "pdf", material, o, i, coat=coat)["density"].sum(axis=1)
    albedo = material.albedo[0] * (1.0 - material.metallic)
    f = albedo * value["diffuse"] + value["specular"][:, 0]
    mirrored = drawn["specular"] == MIRRORED
    body, inputs = "cosine = brdf_cosine((float3)(0.0f, 0.0f, 1.0f), wi);", {"wi": i}
    defines = ("PRINCIPLED", "COVERED", "COAT_NORMALS")
    outputs = {"cosine": "float"}
    cosine = evaluate(device, ["world/brdf.h"], body, inputs, outputs, None, defines)["cosine"]
    return np.where(mirrored, drawn["weight"][:, 0], f * cosine / np.maximum(density, 1e-20))


def test_all_of_the_clearcoats_light_is_found_whatever_lies_below(device: ComputeDevice) -> None:
    """A steep bump below a lacquer does not shade it."""
    black = Material("principled", (0.0, 0.0, 0.0), 1.0, 1.001, clearcoat=1.0)
    coat = oracle.direction(50, 180)
    for alpha in (0.0, 0.1):
        material = black.edited(clearcoat_alpha=alpha)
        o = oracle.normalized(coat + np.array([0.9, 0.3, 0.0]))
        drawn = call(device, "sample", material, o, grid(48, 48), coat=coat)
        assert (drawn["wi"][drawn["weight"][:, 0] > 0, 2] < 0).mean() > 0.2
        found = weights(device, material, o, coat, drawn).mean()
        expected = oracle.covered_albedo(material, oracle.around(coat, o))["clearcoat"][0]
        assert found == pytest.approx(expected, rel=0.03)


def test_a_smooth_clearcoat_mirrors_about_its_own_normal(device: ComputeDevice) -> None:
    material = Material("principled", WHITE, 0.5, clearcoat=0.5)
    coat, normal = oracle.direction(30, 70), oracle.normalized(np.array([0.3, -0.5, -0.8]))
    x = oracle.normalized(np.cross(normal, [0.0, 1.0, 0.0]))
    o = oracle.normalized(normal + 0.2 * x)
    drawn = call(device, "sample", material, o, rng.random((4000, 3)), normal, coat)
    mirrored = drawn["specular"] == MIRRORED
    assert mirrored.sum() > 500
    wi = drawn["wi"][mirrored]
    np.testing.assert_allclose(wi, np.tile(wi[0], (len(wi), 1)), atol=1e-6)
    half = oracle.half(o, wi[0].astype(float))
    assert half @ normal == pytest.approx(np.cos(np.radians(30)), abs=1e-5)
    chosen = np.clip(0.5 * oracle.fresnel(half @ o, 1.5), 0.25, 0.75)
    expected = 0.5 * oracle.fresnel(half @ o, 1.5) / chosen
    np.testing.assert_allclose(drawn["weight"][mirrored], expected, rtol=1e-3)


@pytest.mark.parametrize("material", MATERIALS)
def test_what_lies_below_is_reciprocal(device: ComputeDevice, material: Material) -> None:
    coat, a, b = oracle.direction(40, 20), sphere(20000), sphere(20000)
    above = np.min([a[:, 2], b[:, 2], a @ coat, b @ coat], axis=0) > 0.02
    one = material.edited(clearcoat_alpha=0.0)  # a smooth lobe is no value
    forth = call(device, "eval", one, a[above], b[above], coat=coat)
    back = call(device, "eval", one, b[above], a[above], coat=coat)
    for lobe in ("diffuse", "specular"):
        scale = np.maximum(1, np.abs(forth[lobe]))
        assert np.max(np.abs(forth[lobe] - back[lobe]) / scale) < 1e-5


@pytest.mark.parametrize("function", ["sample", "eval", "pdf"])
def test_the_shading_normal_as_the_clearcoats_changes_nothing(
    device: ComputeDevice, function: str
) -> None:
    normal = oracle.normalized(np.array([0.3, -0.5, -0.8]))
    o = oracle.normalized(normal + np.array([0.3, 0.2, 0.1]))
    last = rng.random((4000, 3)) if function == "sample" else sphere(4000)
    last = last if function == "sample" else last[last @ normal > 0.01]
    for material in MATERIALS:
        plain = call(device, function, material, o, last, normal)
        own = call(device, function, material, o, last, normal, oracle.Z)
        for name, values in plain.items():
            np.testing.assert_allclose(own[name], values, rtol=1e-4, atol=1e-6)


def test_packed_normals_are_unpacked(device: ComputeDevice) -> None:
    n, coat = sphere(4000), sphere(4000)
    coat = np.where((np.sum(n * coat, axis=1) > -0.99)[:, None], coat, n)
    found = evaluate(
        device,
        ["world/finish.h"],
        """
        const float2 packed = packed_coat_normal(n, coat);
        unpacked = frame_to_world(build_frame(n), unpacked_coat_normal(packed));
        alike = unpacked_coat_normal((float2)(0.0f));
        """,
        {"n": np.float32(n), "coat": np.float32(coat)},
        {"unpacked": "float3", "alike": "float3"},
        None,
        ("COAT_NORMALS",),
    )
    np.testing.assert_allclose(found["unpacked"], coat, atol=3e-6)
    np.testing.assert_array_equal(found["alike"], np.tile(oracle.Z, (len(n), 1)))
