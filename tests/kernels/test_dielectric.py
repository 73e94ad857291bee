"""cl/lib/world/dielectric.h: energy, Snell's law, Walter's BSDF, the media that a ray is in."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material, material_table
from tests.kernels.brdf import grid
from tests.kernels.wrap import evaluate
from tests.oracles.brdf import direction, fresnel, ggx, smith_lambda

Array = NDArray[np.float64]
ANGLES = [0, 35, 60, 85]
OUTWARD, INWARD = 1.5, 1.0 / 1.5


def sampled(
    device: ComputeDevice, material: Material, eta: float, o: Array, u: Array, least: float = 0.0
) -> tuple[Array, Array]:
    """Directions and weights (N, 3) of `sample_dielectric`."""
    count = len(u)
    found = evaluate(
        device,
        ["world/dielectric.h"],
        "wi = sample_dielectric(load_material(materials, 0), eta, color, o, u, least, &weight);",
        {
            "eta": np.full(count, eta, np.float32),
            "color": np.tile(np.float32(material.albedo), (count, 1)),
            "o": np.tile(np.float32(o), (count, 1)),
            "u": np.float32(u),
            "least": np.full(count, least, np.float32),
        },
        {"wi": "float3", "weight": "float3"},
        {"materials": material_table([material])},
        ("GLASS",),
    )
    return found["wi"].astype(np.float64), found["weight"].astype(np.float64)


def glass(alpha: float = 0.0, *, thin: bool = False) -> Material:
    return Material("dielectric", (1.0, 1.0, 1.0), alpha=alpha, thin=thin)


@pytest.mark.parametrize("least", [0.0, 0.25])
@pytest.mark.parametrize("eta", [OUTWARD, INWARD, 1.0])
@pytest.mark.parametrize("angle", ANGLES)
def test_a_smooth_surface_refracts_by_snell_and_loses_nothing(
    device: ComputeDevice, angle: float, eta: float, least: float
) -> None:
    o = direction(angle, 30.0)
    wi, weight = sampled(device, glass(), eta, o, grid(4, 512), least)
    reflected = wi[:, 2] > 0.0
    np.testing.assert_allclose(
        wi[reflected], np.tile([-o[0], -o[1], o[2]], (reflected.sum(), 1)), atol=1e-6
    )
    sine = np.sqrt(1.0 - o[2] ** 2) / eta
    assert (~reflected).any() == (sine < 1.0)
    share = weight[:, 0] * np.where(reflected, 1.0, eta**2)
    assert share.mean() == pytest.approx(1.0, abs=2.0 / 512)
    if sine < 1.0:
        through = wi[~reflected][0]
        np.testing.assert_allclose(
            through, [-o[0] / eta, -o[1] / eta, -np.sqrt(1 - sine**2)], atol=1e-6
        )
        expected = fresnel(np.array(o[2]), eta) if eta != 1.0 else 0.0
        assert np.where(reflected, share, 0.0).mean() == pytest.approx(expected, abs=2.0 / 512)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_thin_wall_reflects_what_both_sides_do(device: ComputeDevice, angle: float) -> None:
    """R + T² R + T² R³ + ... = 2 R / (1 + R), and the rest goes straight on."""
    o = direction(angle, 30.0)
    wi, weight = sampled(device, glass(thin=True), 1.5, o, grid(4, 512), 0.25)
    reflected = wi[:, 2] > 0.0
    np.testing.assert_allclose(wi[~reflected], np.tile(-o, ((~reflected).sum(), 1)), atol=1e-6)
    once = fresnel(np.array(o[2]), 1.5)
    found = np.where(reflected, weight[:, 0], 0.0).mean()
    assert found == pytest.approx(2.0 * once / (1.0 + once), abs=2.0 / 512)
    assert weight[:, 0].mean() == pytest.approx(1.0, abs=2.0 / 512)


def walter(o: Array, i: Array, eta: float, alpha: float) -> tuple[Array, Array]:
    """f cos of radiance, and the density of sampling visible normals, for refracted i (N, 3).

    B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", equations 16, 17
    and 21, with the viewer on the side of index 1.
    """
    h = -(eta * i + o)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    h *= np.sign(h[:, 2:])
    i_h, o_h = (i * h).sum(1), h @ o
    valid = (o_h > 0.0) & (i_h < 0.0)
    below = (eta * i_h + o_h) ** 2
    masked = 1.0 / (1.0 + smith_lambda(o, alpha)) / (1.0 + smith_lambda(i, alpha))
    kept = 1.0 - fresnel(np.clip(o_h, 0.0, 1.0), eta)
    distribution = ggx(h, alpha)
    value = np.abs(i_h) * o_h / o[2] * kept * masked * distribution / below
    visible = distribution / (1.0 + smith_lambda(o, alpha)) * o_h / o[2]
    density = kept * visible * eta**2 * np.abs(i_h) / below
    return np.where(valid, value, 0.0), np.where(valid, density, 0.0)


@pytest.mark.parametrize("eta", [OUTWARD, INWARD])
@pytest.mark.parametrize("angle", [10, 60])
@pytest.mark.parametrize("alpha", [0.15, 0.5])
def test_rough_refraction_is_walters(
    device: ComputeDevice, alpha: float, angle: float, eta: float
) -> None:
    """Weights are f cos over the density, by which the directions are distributed."""
    o = direction(angle, 0.0)
    u = np.random.default_rng(2).random((400_000, 3))
    wi, weight = sampled(device, glass(alpha), eta, o, u)
    below = (wi[:, 2] < 0.0) & (weight[:, 0] > 0.0)  # reflection below the surface has none
    through = below & (wi[:, 2] < -0.01)
    up = weight[:, 0] * (wi[:, 2] > 0.01)
    masked = 1.0 / (1.0 + smith_lambda(np.where(up[:, None] > 0.0, wi, o), alpha))
    np.testing.assert_allclose(up[up > 0.0], masked[up > 0.0], rtol=1e-3)
    value, density = walter(o, wi[through], eta, alpha)
    known = density > 1e-3
    np.testing.assert_allclose(
        weight[through][known, 0], (value / np.maximum(density, 1e-9))[known], rtol=1e-2
    )
    # Counts of directions in cells of equal solid angle below the surface.
    z = -(np.arange(3200) + 0.5) / 3200
    phi = (np.arange(320) + 0.5) / 320 * 2.0 * np.pi
    z, phi = (values.ravel() for values in np.meshgrid(z, phi, indexing="ij"))
    sine = np.sqrt(1.0 - z**2)
    _, density = walter(o, np.stack([sine * np.cos(phi), sine * np.sin(phi), z], -1), eta, alpha)
    cells = density.reshape(10, 320, 16, 20).mean((1, 3)) * 2.0 * np.pi / 160
    turn = np.arctan2(wi[:, 1], wi[:, 0]) % (2.0 * np.pi)
    counts, _, _ = np.histogram2d(
        -wi[below, 2], turn[below], (10, 16), ((0.0, 1.0), (0.0, 2.0 * np.pi))
    )
    np.testing.assert_allclose(counts / len(wi), cells, atol=3e-3)


@pytest.mark.parametrize("thin", [False, True])
@pytest.mark.parametrize("alpha", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("angle", ANGLES)
def test_a_rough_surface_creates_no_light(
    device: ComputeDevice, angle: float, alpha: float, thin: bool
) -> None:
    wi, weight = sampled(device, glass(alpha, thin=thin), OUTWARD, direction(angle), grid(48, 16))
    back = np.where((wi[:, 2] < 0.0) & (not thin), OUTWARD**2, 1.0)
    share = weight[:, 0] * back
    assert share.mean() < 1.0 + 1e-3
    if alpha <= 0.1 and angle <= 60:
        assert share.mean() > 0.97


def test_the_media_of_a_ray_are_a_stack(device: ComputeDevice) -> None:
    """The twin is a list: entered twice counts once, all can be left, at most four are known."""
    rng = np.random.default_rng(5)
    states, expected, actions = [], [], []
    inside: list[int] = []
    for _ in range(400):
        material = int(rng.choice([0, 1, 2, 300, 65000]))
        enters = bool(rng.random() < 0.5)
        states.append(list(inside))
        actions.append((material, enters))
        if enters and material not in inside:
            inside = [material, *inside][:4]
        elif not enters and material in inside:
            inside.remove(material)
        expected.append(list(inside))

    def packed(lists: list[list[int]]) -> NDArray[np.uint64]:
        return np.array(
            [sum((m + 1) << 16 * place for place, m in enumerate(one)) for one in lists], np.uint64
        )

    before, after = packed(states), packed(expected)
    material, enters = (np.array(values, np.int32) for values in zip(*actions, strict=True))
    found = evaluate(
        device,
        ["world/dielectric.h"],
        "const ulong media = (ulong)high << 32 | (ulong)low;"
        "const ulong now = enters ? entered(media, material) : left_behind(media, material);"
        "new_high = (uint)(now >> 32); new_low = (uint)now;",
        {
            "high": (before >> np.uint64(32)).astype(np.uint32),
            "low": (before & np.uint64(0xFFFFFFFF)).astype(np.uint32),
            "material": material,
            "enters": enters,
        },
        {"new_high": "uint", "new_low": "uint"},
        {},
        ("GLASS",),
    )
    now = found["new_high"].astype(np.uint64) << np.uint64(32) | found["new_low"]
    np.testing.assert_array_equal(now, after)
