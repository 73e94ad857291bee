"""iprt/truth/covered.py: layers of principled materials, as Mitsuba evaluates and samples them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.geometry.material import Material
from tests.oracles import brdf as oracle

pytestmark = pytest.mark.mitsuba

SAMPLES = 1 << 18
RED = (0.8, 0.3, 0.2)
MATERIALS = [
    Material("principled", RED, 0.3, clearcoat=1.0, clearcoat_alpha=0.1),
    Material("principled", RED, 0.2, metallic=0.5, clearcoat=0.4, clearcoat_alpha=0.3),
    Material("principled", RED, 0.5, sheen=(0.7, 0.9, 0.2), sheen_alpha=0.1),
    Material("principled", RED, 0.3, tint=(0.1, 0.6, 1.0)),
    Material(
        "principled",
        RED,
        0.4,
        clearcoat=0.7,
        clearcoat_alpha=0.2,
        sheen=(0.5, 0.5, 0.5),
        tint=(0.5, 1.0, 0.2),
    ),
]


def surface(mi: Any, o: np.ndarray, count: int) -> Any:
    """Return interactions seen from o, in the frame of the normal."""
    dr = pytest.importorskip("drjit")
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.sh_frame = mi.Frame3f(mi.Vector3f(0.0, 0.0, 1.0))
    si.wi = mi.Vector3f(*o.tolist())
    si.uv = mi.Point2f(0.5, 0.5)
    si.dp_du = mi.Vector3f(1.0, 0.0, 0.0)
    return si


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("angle", [10.0, 50.0, 80.0])
def test_values_equal_the_twin(mi: Any, material: Material, angle: float) -> None:
    """Up to the masking below, which is separable in Mitsuba."""
    from iprt.truth.shapes import bsdf_of

    rng = np.random.default_rng(3)
    i = oracle.normalized(rng.normal(size=(500, 3)))
    i[:, 2] = np.abs(i[:, 2]).clip(0.02)
    i = oracle.normalized(i)
    o = oracle.direction(angle, 20.0)
    bsdf = bsdf_of(material)
    value = bsdf.eval(mi.BSDFContext(), surface(mi, o, len(i)), mi.Vector3f(i.T.astype(np.float32)))
    diffuse = (1.0 - material.metallic) * np.array(material.albedo)
    expected = oracle.evaluate_diffuse(material, o, i)[:, None] * diffuse
    lower, upper = (
        (expected + oracle.evaluate_specular(material, o, i, separable)) * i[:, 2:]
        for separable in (True, False)
    )
    seen = np.array(value).T
    slack = 0.02 * upper + 1e-3
    assert (seen > np.minimum(lower, upper) - slack).all()
    assert (seen < np.maximum(lower, upper) + slack).all()


TILTS = oracle.direction(25.0, 100.0), oracle.direction(40.0, -30.0)


def bent(material: Material, *, below: bool, above: bool) -> Material:
    """Return a material with maps of `TILTS` for itself and for its clear coat."""
    base, lacquer = (np.float32(tilt)[None, None] for tilt in TILTS)
    base, lacquer = base if below else None, lacquer if above else None
    return replace(material, normal_texture=base, clearcoat_normal_texture=lacquer)


@pytest.mark.parametrize(("below", "above"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("material", [MATERIALS[0], MATERIALS[1], MATERIALS[4]])
def test_normals_of_clear_coats(mi: Any, material: Material, below: bool, above: bool) -> None:
    """Values are the twin's in the frame of the map below, and the mean of samples is theirs."""
    from iprt.truth.shapes import bsdf_of

    rng = np.random.default_rng(3)
    i = oracle.normalized(np.abs(rng.normal(size=(500, 3))) * [1.0, -1.0, 1.0])
    o = oracle.direction(30.0, 20.0)
    base, lacquer = TILTS[0] if below else oracle.Z, TILTS[1] if above else oracle.Z
    own_o, own_i = (oracle.around(base, v) for v in (o, i))
    lacquer = oracle.around(base, lacquer)
    kept = (own_i[:, 2] > 0.02) & (own_i @ lacquer > 0.02)
    i, own_i = i[kept], own_i[kept]
    bsdf = bsdf_of(bent(material, below=below, above=above))
    si = surface(mi, o, len(i))
    value = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(i.T.astype(np.float32)))
    diffuse = (1.0 - material.metallic) * np.array(material.albedo)
    expected = oracle.evaluate_diffuse(material, own_o, own_i, lacquer)[:, None] * diffuse
    lower, upper = (
        (expected + oracle.evaluate_specular(material, own_o, own_i, separable, lacquer))
        * own_i[:, 2:]
        for separable in (True, False)
    )
    seen, slack = np.array(value).T, 0.02 * upper + 1e-3
    # Mitsuba darkens bumps a little more.
    assert (seen > np.minimum(lower, upper) - slack - 0.08 * below * upper).all()
    assert (seen < np.maximum(lower, upper) + slack).all()
    confirm_samples(mi, bsdf)


@pytest.mark.parametrize("material", MATERIALS)
def test_samples_have_the_mean_of_the_values(mi: Any, material: Material) -> None:
    from iprt.truth.shapes import bsdf_of

    confirm_samples(mi, bsdf_of(material))


def confirm_samples(mi: Any, bsdf: Any) -> None:
    """Compare the mean of a BSDF's samples with that of its values."""
    o = oracle.direction(50.0, 20.0)
    si = surface(mi, o, SAMPLES)
    rng = np.random.default_rng(4)
    first, second = rng.random(SAMPLES), rng.random((2, SAMPLES))
    drawn, weight = bsdf.sample(mi.BSDFContext(), si, mi.Float(first), mi.Point2f(second))
    assert np.array(drawn.pdf).min() >= 0.0
    weight = np.array(weight).T
    error = weight.std(axis=0) / np.sqrt(SAMPLES)
    uniform = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.random((2, SAMPLES))))
    value = 2.0 * np.pi * np.array(bsdf.eval(mi.BSDFContext(), si, uniform)).T
    error = error + value.std(axis=0) / np.sqrt(SAMPLES)
    assert (np.abs(weight.mean(axis=0) - value.mean(axis=0)) < 4.0 * error).all()
