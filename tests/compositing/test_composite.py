"""Differential rendering of real and virtual layer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from iprt.compositing.composite import Composite
from iprt.compositing.diffuse_part import DiffusePart
from iprt.compositing.real_layer import UNEVEN
from iprt.device.compute import ComputeDevice
from iprt.gbuffer.layout import PlaneLayout
from iprt.world.real.color_map import ColorMap
from tests.filter.gbuffer import SIZES, upload


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
    color, albedo, light, shine, ratio = rng.random((5, 3, height, width))
    coverage = rng.choice([0.0, 0.3, 1.0], (height, width))
    planes = {
        "coverage": coverage[None] if diffuse or specular else None,
        "albedo": albedo if diffuse else None,
        "diffuse": light if diffuse else None,
        "specular": shine if specular else None,
    }
    arrays = {k: None if v is None else upload(device, layout, v) for k, v in planes.items()}
    at_edge = rng.random((height, width)) < 0.4
    itself = np.arange(width * height).reshape(height, width)
    second = (itself + rng.integers(1, max(width * height, 2), itself.shape)) % itself.size
    at_edge &= second != itself
    share = at_edge * rng.random((3, height, width))
    # How much of either surface is hidden there; elsewhere of the only one.
    hidden = np.where(at_edge & (coverage > 0.0), rng.random((2, height, width)), coverage)
    arrays |= edges(device, layout, share, np.where(at_edge, second, -1), hidden)
    if relit:
        arrays["ratio"] = device.upload("ratio", pixels(ratio))
    composite = Composite(device, layout)
    composite.run(upload(device, layout, color), **arrays)
    picture = np.moveaxis(device.read(composite.picture), -1, 0)
    if not (diffuse or specular):
        coverage, hidden = 0.0 * coverage, 0.0 * hidden
    ratio = ratio if relit else np.ones_like(ratio)
    beyond = ratio.reshape(3, -1)[:, second]
    expected = coverage * (diffuse * albedo * light + specular * shine)
    expected = expected + (1.0 - hidden[0]) * (1.0 - share) * color * ratio
    expected = expected + (1.0 - hidden[1]) * share * color * beyond
    np.testing.assert_allclose(picture[:3], expected, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(picture[3], coverage, rtol=1e-6)


@pytest.mark.parametrize(("color_map", "gloss"), [(False, False), (True, False), (False, True)])
def test_untouched_pixels_keep_their_bits(
    device: ComputeDevice, color_map: bool, gloss: bool
) -> None:
    rng = np.random.default_rng(1)
    layout = PlaneLayout(31, 17)
    color = rng.gamma(0.3, 2.0, (3, 17, 31)).astype(np.float32)
    color.ravel()[:3] = 0.0, 1e-30, 65504.0
    unlit = np.full((3, 17, 31), np.nan)
    base = np.einsum("ij,jyx->iyx", COLOR_MAP, color) if color_map else 0.3 * color
    composite = Composite(device, layout)
    composite.run(
        upload(device, layout, color),
        ratio=device.upload("ratio", pixels(np.ones((3, 17, 31)))),
        **edges(device, layout, rng.random((3, 17, 31)), rng.choice([-1, UNEVEN], (17, 31))),
        base=upload(device, layout, base) if color_map or gloss else None,
        change=upload(device, layout, np.zeros_like(color)) if gloss else None,
        coverage=upload(device, layout, np.zeros((1, 17, 31))),
        albedo=upload(device, layout, unlit),
        diffuse=upload(device, layout, unlit),
        specular=upload(device, layout, unlit),
        color_map=mapped_rows(device).rows if color_map else None,
    )
    picture = device.read(composite.picture)
    assert np.array_equal(picture[..., :3], np.moveaxis(color, 0, -1))
    assert not picture[..., 3].any()


def edges(
    device: ComputeDevice,
    layout: PlaneLayout,
    share: np.ndarray | None = None,
    second: np.ndarray | None = None,
    hidden: np.ndarray | None = None,
) -> dict[str, Any]:
    """Shares (3, H, W) of a second surface, pixels (H, W) that show it, and how much of either is
    hidden (2, H, W); by default there is none.
    """
    size = layout.height, layout.width
    share = np.full((3, *size), np.nan) if share is None else share
    second = np.full(size, -1) if second is None else second
    hidden = np.full((2, *size), np.nan) if hidden is None else hidden
    corner = np.arange(layout.width * layout.height)[::-1, None].repeat(4, axis=1)
    return {
        "other": device.upload("other", pixels(share)),
        "other_pixel": device.upload("other pixel", second.ravel().astype(np.int32)),
        "corner": device.upload("corner", corner.astype(np.int32)),
        "sides": device.upload("sides", np.moveaxis(hidden, 0, -1).astype(np.float32)),
    }


def pixels(ratio: np.ndarray) -> np.ndarray:
    """(H * W, 4) float32 from (3, H, W), w = 1."""
    four = np.concatenate([ratio, np.ones_like(ratio[:1])])
    return np.moveaxis(four, 0, -1).reshape(-1, 4).astype(np.float32)


COLOR_MAP = np.array([[1.4, 0.2, 0.0], [0.1, 2.0, 0.1], [0.0, 0.3, 1.1]])
"""A frame's colors to the reference's."""


def mapped_rows(device: ComputeDevice) -> ColorMap:
    color_map = ColorMap(device)
    color_map.load(COLOR_MAP)
    return color_map


@pytest.mark.parametrize(("mapped", "gloss"), [(True, False), (True, True), (False, True)])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_reflections_change_apart_and_all_is_mapped_back(
    device: ComputeDevice, width: int, height: int, mapped: bool, gloss: bool
) -> None:
    rng = np.random.default_rng(4)
    layout = PlaneLayout(width, height)
    color, base, albedo, light, shine, ratio = rng.random((6, 3, height, width))
    change = rng.normal(size=color.shape) if gloss else np.zeros(color.shape)
    coverage = rng.choice([0.0, 0.3, 1.0], (height, width))
    composite = Composite(device, layout)
    composite.run(
        upload(device, layout, color),
        ratio=device.upload("ratio", pixels(ratio)),
        **edges(device, layout),
        base=upload(device, layout, base),
        change=upload(device, layout, change) if gloss else None,
        coverage=upload(device, layout, coverage[None]),
        albedo=upload(device, layout, albedo),
        diffuse=upload(device, layout, light),
        specular=upload(device, layout, shine),
        color_map=mapped_rows(device).rows if mapped else None,
    )
    picture = np.moveaxis(device.read(composite.picture), -1, 0)
    inverse = np.linalg.inv(COLOR_MAP) if mapped else np.eye(3)

    def back(values: np.ndarray) -> np.ndarray:
        return np.einsum("ij,jyx->iyx", inverse, values)

    if gloss:  # a highlight loses no more than it has
        seen = np.einsum("ij,jyx->iyx", COLOR_MAP, color) if mapped else color
        change = np.maximum(change, -np.maximum(seen - base, 0.0))
    real = np.maximum(color + back(base * (ratio - 1.0) + change), 0.0)
    expected = coverage * np.maximum(back(albedo * light + shine), 0.0) + (1.0 - coverage) * real
    np.testing.assert_allclose(picture[:3], expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(picture[3], coverage, rtol=1e-6)


@pytest.mark.parametrize("gloss", [False, True])
def test_diffuse_part(device: ComputeDevice, gloss: bool) -> None:
    """Colors are mapped first; reflections, which may be infinite, are removed."""
    rng = np.random.default_rng(6)
    layout = PlaneLayout(31, 17)
    color, shine = rng.random((2, 3, 17, 31))
    shine[:, 3] = np.inf
    part = DiffusePart(device, layout, name="test", gloss=gloss, color_map=True)
    planes = upload(device, layout, color)
    highlight = upload(device, layout, shine) if gloss else None
    rows = mapped_rows(device).rows
    found = layout.interior(device.read(part.run(planes, highlight, rows)))
    expected = np.einsum("ij,jyx->iyx", COLOR_MAP, color) - (shine if gloss else 0.0)
    np.testing.assert_allclose(found, np.maximum(expected, 0.0), rtol=1e-5, atol=1e-6)
    plain = part.run(planes, highlight, None)
    if gloss:
        expected = np.maximum(color.astype(np.float32) - shine.astype(np.float32), 0.0)
        np.testing.assert_array_equal(layout.interior(device.read(plain)), expected)
    else:
        assert plain is planes
