"""The materials equal Mitsuba's, whose path tracer makes the truth that pictures are compared to.

One difference is deliberate. Mitsuba multiplies two Smith terms G1(o) G1(i); we use the
height-correlated G2, so the specular lobes are compared after exchanging the one for the other.
"""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from iprt.geometry.material import Material
from tests.kernels.brdf import call
from tests.oracles import brdf as oracle

pytestmark = pytest.mark.mitsuba
MATERIALS = [
    Material("diffuse", (0.6, 0.3, 0.2)),
    Material("conductor", (0.9, 0.8, 0.6), 0.02),
    Material("conductor", (0.9, 0.8, 0.6), 0.1),
    Material("conductor", (0.9, 0.8, 0.6), 0.5),
    Material("plastic", (0.55, 0.06, 0.05), 0.05, 1.5),
    Material("plastic", (0.55, 0.06, 0.05), 0.2, 1.5),
    Material("plastic", (0.5, 0.4, 0.3), 0.5, 1.9),
    Material("plastic", (0.5, 0.4, 0.3), 0.0, 1.5),
    Material("principled", (0.9, 0.5, 0.2), 0.2, metallic=1.0),
    Material("principled", (0.9, 0.5, 0.2), 0.1, metallic=0.3),
]

# In a process of its own: a variant is global to the process, and the truth tests choose theirs.
SCRIPT = """
import json, sys
import mitsuba as mi
mi.set_variant("scalar_rgb")
results = []
for job in json.load(sys.stdin):
    bsdf, values = mi.load_dict(job["bsdf"]), []
    for o, i in job["pairs"]:
        surface = mi.SurfaceInteraction3f()
        surface.wi = mi.Vector3f(*o)
        values.append([*bsdf.eval(mi.BSDFContext(), surface, mi.Vector3f(*i))])
    results.append(values)
json.dump(results, sys.stdout)
"""


def plugin(material):
    rgb = {"type": "rgb", "value": list(material.albedo)}
    if material.kind == "diffuse":
        return {"type": "diffuse", "reflectance": rgb}
    if material.kind == "principled":
        metal = {"type": "principled", "base_color": rgb, "metallic": 1.0}
        metal["roughness"] = material.alpha**0.5
        plastic = plugin(replace(material, kind="plastic"))
        weight = material.metallic
        return {"type": "blendbsdf", "weight": weight, "plastic": plastic, "metal": metal}
    rough = {"distribution": "ggx", "alpha": material.alpha} if material.alpha else {}
    prefix = "rough" if rough else ""
    if material.kind == "conductor":
        named = {"type": prefix + "conductor", "material": "none", "specular_reflectance": rgb}
        return {**named, **rough}
    named = {"type": prefix + "plastic", "int_ior": material.ior, "ext_ior": 1.0}
    return {**named, **rough, "nonlinear": False, "diffuse_reflectance": rgb}


def random_pairs(alpha, count=300):
    """Half of them near the mirror direction, where the lobe is."""
    rng = np.random.default_rng(2)
    o, i = (oracle.normalized(rng.normal(size=(count, 3))) for _ in range(2))
    o[:, 2], i[:, 2] = np.abs(o[:, 2]), np.abs(i[:, 2])
    h = oracle.normalized([0, 0, 1] + max(alpha, 0.01) * rng.normal(size=(count, 3)))
    mirrored = 2 * np.sum(o * h, -1, keepdims=True) * h - o
    i[::2] = mirrored[::2]
    pairs = np.stack([o, i], 1)
    return pairs[(pairs[..., 2] > 0.03).all(1)].astype(np.float32).astype(float)


@pytest.fixture(scope="module")
def mitsuba_values():
    """Per material, (N, 3) f cos of its random pairs."""
    pytest.importorskip("mitsuba", reason="needs the `reference` extra")
    jobs = [{"bsdf": plugin(m), "pairs": random_pairs(m.alpha).tolist()} for m in MATERIALS]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=json.dumps(jobs),
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(zip(MATERIALS, map(np.array, json.loads(done.stdout)), strict=True))


@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: f"{m.kind}-{m.alpha}")
def test_reflectance_equals_mitsubas(device, mitsuba_values, material):
    pairs = random_pairs(material.alpha)
    o, i = pairs[:, 0], pairs[:, 1]
    truth = mitsuba_values[material] / i[:, 2:]
    value = call(device, "eval", material, o, i)
    lambda_o, lambda_i = (oracle.smith_lambda(v, material.alpha) for v in (o, i))
    separable = (1 + lambda_o + lambda_i) / ((1 + lambda_o) * (1 + lambda_i))
    ours = (1 - material.metallic) * value["diffuse"][:, None] * np.array(material.albedo)
    ours = ours + value["specular"] * separable[:, None]
    np.testing.assert_allclose(ours, truth, rtol=4e-3, atol=1e-5)
    # Mitsuba fits the internal reflectance of a smooth coat by a polynomial, 0.1% off the integral.
    assert abs(np.mean(ours) / np.mean(truth) - 1) < (1e-3 if material.alpha else 2e-3)
