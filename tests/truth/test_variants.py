"""Maps of variants in Mitsuba: values at texels and between them, and pictures beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.geometry.sampler import Sampler
from iprt.geometry.variants import Variants
from iprt.measure.metrics import ssim
from iprt.output.display import display
from iprt.settings.model import Settings
from tests.oracles import brdf as oracle
from tests.oracles.worlds import World
from tests.raster.shapes import placed, quad
from tests.rendering import render
from tests.truth.test_covered import surface
from tests.truth.test_panorama import shot
from tests.worlds import bright_walls, room_frame

pytestmark = [pytest.mark.mitsuba, pytest.mark.thorough]

RED = (0.8, 0.3, 0.2)
BASE = Material(
    "principled", RED, 0.3, clearcoat=0.5, clearcoat_alpha=0.1, sheen=(0.5, 0.2, 0.1), ior=1.6
)
INDEX = np.array([[0, 1, 2, 0], [2, 0, 1, 1]], np.uint8)
ROWS = (
    (0.0, 0.1, (0.0, 0.0, 0.0), 0.25, (1.0, 1.0, 1.0)),
    (1.0, 0.2, (0.5, 0.2, 0.1), 0.1, (0.3, 1.0, 0.5)),
    (0.5, 0.4, (1.0, 0.6, 0.3), 0.6, (1.0, 0.2, 0.1)),
)
NAMES = ("clearcoat", "clearcoat_alpha", "sheen", "sheen_alpha", "tint")
VIEW = View(48, 48, pitch_deg=-25.0, fov_y_deg=40.0)


def mapped(sampler: Sampler) -> Material:
    return replace(BASE, variants=Variants(NAMES, ROWS, INDEX, sampler))


def value(mi: Any, material: Material, uv: np.ndarray) -> np.ndarray:
    """The BSDF at texture coordinates (N, 2), in one pair of directions."""
    from iprt.truth.shapes import bsdf_of

    bsdf = bsdf_of(material)
    bsdf = mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf
    o, i = (oracle.direction(angle, turn) for angle, turn in ((50.0, 20.0), (60.0, 185.0)))
    si = surface(mi, o, len(uv))
    si.uv = mi.Point2f(uv.T.astype(np.float32))
    found = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*i.tolist()))
    return np.array(found).T


@pytest.mark.parametrize("nearest", [True, False])
def test_a_texel_has_the_values_of_its_variant(mi: Any, nearest: bool) -> None:
    """At its centre; beyond 0 and 1 it is mirrored along v."""
    material = mapped(Sampler(("repeat", "mirror"), nearest))
    rows, columns = np.indices((2, 4)).reshape(2, -1)
    uv = np.stack([(columns + 0.5) / 4 + 2.0, (rows + 0.5) / 2 + 1.0], axis=-1)
    plain = np.concatenate([value(mi, one, uv[:1]) for one in material.palette])
    assert np.abs(np.diff(plain, axis=0)).max() > 0.02
    np.testing.assert_allclose(value(mi, material, uv), plain[INDEX[rows, columns]], rtol=1e-4)


def test_between_texels_lies_their_mean(mi: Any) -> None:
    material = mapped(Sampler())
    x = np.random.default_rng(3).uniform(1.5, 2.5, 40_000)
    uv = np.stack([x / 4, np.full(len(x), 0.75)], axis=-1)
    plain = np.concatenate([value(mi, one, uv[:1]) for one in material.palette])
    found = value(mi, material, uv)
    share = x - 1.5
    error = found - ((1.0 - share)[:, None] * plain[1] + share[:, None] * plain[2])
    assert (np.abs(error.mean(axis=0)) < 4.0 * error.std(axis=0) / np.sqrt(len(x))).all()


def body(material: Material) -> Instance:
    """A board that is seen at a slant."""
    tilt = View(1, 1, pitch_deg=-75.0).world_from_view
    return placed(quad((material,)), (0.0, -0.6, -1.3), 0.35, tilt)


MATERIALS = {
    "layers": replace(mapped(Sampler()), albedo=(0.1, 0.05, 0.05)),
    "transmission": replace(
        Material("principled", RED, 0.0, transmission=0.5, thin=True),
        variants=Variants(("transmission",), ((0.0,), (0.5,), (1.0,)), INDEX),
    ),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_pictures_agree(mi: Any, device: ComputeDevice, name: str) -> None:
    """More than with the means of the map."""
    frame = room_frame(World(), 256, 128, bright_walls)
    truth = shot(frame, [body(MATERIALS[name])], VIEW, 256)
    settings = Settings.model_validate({"fading": 0.0, "gbuffer": "cl"})
    shown = display(truth.color, 1.0)
    scores = []
    for material in (MATERIALS[name], replace(MATERIALS[name], variants=None)):
        found = render(device, frame, [body(material)], VIEW, settings, 32)
        scores.append(ssim(display(found.color, 1.0), shown))
    assert scores[0] > 0.95
    assert scores[1] < scores[0] - 0.005
