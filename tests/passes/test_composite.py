"""Differential rendering of real and virtual layer."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.passes.composite import Composite
from iprt.passes.layout import PlaneLayout
from tests.passes.gbuffer import SIZES, upload


@pytest.mark.parametrize("relit", [False, True])
@pytest.mark.parametrize(
    ("diffuse", "specular"), [(True, False), (False, True), (True, True), (False, False)]
)
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_equation(
    device: ComputeDevice, width: int, height: int, relit: bool, diffuse: bool, specular: bool
) -> None:
    rng = np.random.default_rng(0)
    layout = PlaneLayout(width, height)
    colour, albedo, light, shine, ratio = rng.random((5, 3, height, width))
    coverage = rng.choice([0.0, 0.3, 1.0], (height, width))
    planes = {
        "coverage": coverage[None] if diffuse or specular else None,
        "albedo": albedo if diffuse else None,
        "diffuse": light if diffuse else None,
        "specular": shine if specular else None,
    }
    arrays = {k: None if v is None else upload(device, layout, v) for k, v in planes.items()}
    arrays["ratio"] = device.upload("ratio", pixels(ratio)) if relit else None
    composite = Composite(device, layout, relit=relit, diffuse=diffuse, specular=specular)
    composite.run(upload(device, layout, colour), **arrays)
    picture = np.moveaxis(device.read(composite.picture), -1, 0)
    coverage = coverage if diffuse or specular else 0.0 * coverage
    expected = coverage * (diffuse * albedo * light + specular * shine)
    expected = expected + (1.0 - coverage) * colour * (ratio if relit else 1.0)
    np.testing.assert_allclose(picture[:3], expected, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(picture[3], coverage, rtol=1e-6)


def test_untouched_pixels_keep_their_bits(device: ComputeDevice) -> None:
    rng = np.random.default_rng(1)
    layout = PlaneLayout(31, 17)
    colour = rng.gamma(0.3, 2.0, (3, 17, 31)).astype(np.float32)
    colour.ravel()[:3] = 0.0, 1e-30, 65504.0
    unlit = np.full((3, 17, 31), np.nan)
    composite = Composite(device, layout, relit=True, diffuse=True, specular=True)
    composite.run(
        upload(device, layout, colour),
        ratio=device.upload("ratio", pixels(np.ones((3, 17, 31)))),
        coverage=upload(device, layout, np.zeros((1, 17, 31))),
        albedo=upload(device, layout, unlit),
        diffuse=upload(device, layout, unlit),
        specular=upload(device, layout, unlit),
    )
    picture = device.read(composite.picture)
    assert np.array_equal(picture[..., :3], np.moveaxis(colour, 0, -1))
    assert not picture[..., 3].any()


def pixels(ratio: np.ndarray) -> np.ndarray:
    """(H * W, 4) float32 from (3, H, W), w = 1."""
    four = np.concatenate([ratio, np.ones_like(ratio[:1])])
    return np.moveaxis(four, 0, -1).reshape(-1, 4).astype(np.float32)


def gloss_picture(
    device: ComputeDevice, colour: np.ndarray, base: np.ndarray, change: np.ndarray, ratio: float
) -> np.ndarray:
    """(3, H, W): a real layer that reflects objects, none of which covers it."""
    _, height, width = colour.shape
    layout = PlaneLayout(width, height)
    composite = Composite(device, layout, relit=True, diffuse=True, specular=False, gloss=True)
    nothing = np.zeros((3, height, width))
    composite.run(
        upload(device, layout, colour),
        ratio=device.upload("ratio", pixels(np.full(colour.shape, ratio))),
        base=upload(device, layout, base),
        change=upload(device, layout, change),
        coverage=upload(device, layout, nothing[:1]),
        albedo=upload(device, layout, nothing),
        diffuse=upload(device, layout, nothing),
    )
    return np.moveaxis(device.read(composite.picture)[..., :3], -1, 0)


def test_reflections_change_apart_from_the_diffuse_part(device: ComputeDevice) -> None:
    rng = np.random.default_rng(2)
    colour = rng.gamma(0.3, 2.0, (3, 17, 31))
    base, change = colour * rng.random(colour.shape), rng.normal(size=colour.shape)
    picture = gloss_picture(device, colour, base, change, 0.6)
    expected = np.maximum(colour - 0.4 * base + change, 0.0)
    np.testing.assert_allclose(picture, expected, rtol=1e-5, atol=1e-6)
    assert (expected == 0.0).any()


def test_unchanged_reflections_keep_their_bits(device: ComputeDevice) -> None:
    colour = np.random.default_rng(3).gamma(0.3, 2.0, (3, 17, 31)).astype(np.float32)
    colour.ravel()[:3] = 0.0, 1e-30, 65504.0
    for base in (colour, 0.3 * colour, np.zeros_like(colour)):
        picture = gloss_picture(device, colour, base, np.zeros_like(colour), 1.0)
        np.testing.assert_array_equal(picture, colour)
