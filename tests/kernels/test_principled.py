"""The principled material of cl/lib/world/brdf.h: limits, energy, and maps of its parameters."""

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material, material_table
from tests.kernels.brdf import call, grid
from tests.kernels.wrap import evaluate
from tests.oracles import brdf as oracle

COLOR = (0.8, 0.5, 0.3)
WHITE = (1.0, 1.0, 1.0)
rng = np.random.default_rng(11)


def upper(count: int) -> np.ndarray:
    z = rng.uniform(0.05, 1, count)
    phi, r = rng.uniform(0, 2 * np.pi, count), np.sqrt(1 - z**2)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)


def test_without_metalness_it_is_plastic(device: ComputeDevice) -> None:
    o, i = oracle.direction(40, 10), upper(2000)
    mixed = call(device, "eval", Material("principled", COLOR, 0.2, 1.6), o, i)
    plastic = call(device, "eval", Material("plastic", COLOR, 0.2, 1.6), o, i)
    for lobe in ("diffuse", "specular"):
        np.testing.assert_allclose(mixed[lobe], plastic[lobe], rtol=1e-6)


def test_a_mixture_is_the_weighted_sum_of_its_parts(device: ComputeDevice) -> None:
    o, i = oracle.direction(55, 10), upper(2000)
    parts = [
        call(device, "eval", Material("principled", COLOR, 0.3, metallic=m), o, i)
        for m in (0.0, 0.25, 1.0)
    ]
    whole = [part["diffuse"][:, None] * np.float32(COLOR) for part in parts]
    whole = [
        (1 - m) * d + p["specular"] for m, d, p in zip((0, 0.25, 1), whole, parts, strict=True)
    ]
    np.testing.assert_allclose(whole[1], 0.75 * whole[0] + 0.25 * whole[2], rtol=1e-5, atol=1e-7)


def test_a_metal_reflects_all_at_grazing_incidence(device: ComputeDevice) -> None:
    """Schlick's term: smooth metal reflects its color at normal incidence and all light at 90°."""
    metal = Material("principled", COLOR, 0.0, metallic=1.0)
    for angle, expected in ((0, COLOR), (89.9, WHITE)):
        o = oracle.direction(angle, 0)
        weight = call(device, "sample", metal, o, grid(4))["weight"]
        np.testing.assert_allclose(weight.mean(axis=0), expected, rtol=0.02)


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("angle", [0, 60, 85])
def test_white_furnace(
    device: ComputeDevice, metallic: float, roughness: float, angle: float
) -> None:
    """The sampled albedo is the integral of the lobes, and at most 1."""
    material = Material("principled", WHITE, roughness**2, metallic=metallic)
    o = oracle.direction(angle, 30)
    drawn = call(device, "sample", material, o, rng.random((1 << 17, 3)))
    specular = drawn["specular"] != 0
    kept = np.where(specular, 1.0, 1.0 - metallic)
    mean = float((drawn["weight"][:, 0] * kept).mean())
    expected = oracle.specular_albedo(material, o)[0]
    if metallic < 1.0:
        expected += (1.0 - metallic) * oracle.diffuse_albedo(material, o)
    assert mean == pytest.approx(expected, abs=0.01)
    assert expected <= 1.0 + 1e-3


@pytest.mark.parametrize("roughness", [0.1, 0.35, 0.62, 0.97])
def test_a_map_of_roughness_gives_the_same_as_the_number(
    device: ComputeDevice, roughness: float
) -> None:
    """The coat's tables for maps have 32 roughnesses, between which it is interpolated."""
    plain = Material("principled", COLOR, roughness**2, 1.5, metallic=0.2)
    image = np.ones((1, 1, 2), np.float32)
    mapped = replace(plain, alpha=1.0, metallic=1.0, surface_texture=image)
    o, i = oracle.direction(50, 0), upper(3000)
    body = """
        const Material m = load_surface_material(materials, 0, finish);
        const BrdfValue v = brdf_eval(m, albedo, (float3)(0.0f, 0.0f, 1.0f), wo, wi);
        diffuse = v.diffuse; specular = v.specular;
    """
    inputs = {
        "albedo": np.tile(np.float32(COLOR), (len(i), 1)),
        "wo": np.tile(np.float32(o), (len(i), 1)),
        "wi": np.float32(i),
        "finish": np.tile(np.float32([0.2, roughness**2]), (len(i), 1)),
    }
    outputs = {"diffuse": "float", "specular": "float3"}
    found = evaluate(
        device,
        ["world/brdf.h"],
        body,
        inputs,
        outputs,
        {"materials": material_table([mapped])},
        ("PRINCIPLED",),
    )
    expected = call(device, "eval", plain, o, i)
    np.testing.assert_allclose(found["specular"], expected["specular"], rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(found["diffuse"], expected["diffuse"], rtol=4e-3)
