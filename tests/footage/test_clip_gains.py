"""Gains from shading alone: what the fit finds, and what bounds it where shading tells nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.footage import gather
from iprt.footage.clip_gains import MAX_GAIN, MAX_REFLECTANCE, Shading, clip_gains
from iprt.footage.frame import Frame
from iprt.footage.gather import (
    Cells,
    Geometry,
    cell_means,
    cell_sums,
    cell_texels,
    form_factors,
    sampled_normals,
    visible,
)
from tests.oracles.worlds import Box, World
from tests.worlds import Float, sphere_frame

NONE = np.zeros(0, np.intp)


def shading(radiance: Float, segment: Float, rest: Float, lights: Float) -> Shading:
    empty = np.zeros((0, 3))
    none = np.zeros((0, 3, lights.shape[2]))
    return Shading(radiance, segment.astype(np.intp), rest, lights, empty, NONE, empty, none)


def lit(gains: Float, noise: float, seed: int = 0) -> Shading:
    """Ten segments of thirty points each under lights of these gains (K, 3)."""
    rng = np.random.default_rng(seed)
    lights = rng.gamma(1.0, 0.1, (300, 1, len(gains))) * np.ones((1, 3, 1))
    rest = rng.uniform(0.3, 0.6, (300, 1)) * np.ones((1, 3))
    segment = np.repeat(np.arange(10), 30)
    reflectance = rng.uniform(0.1, 0.8, (10, 3))[segment]
    received = rest + np.einsum("nck,kc->nc", lights, gains)
    radiance = reflectance / np.pi * received * np.exp(noise * rng.normal(size=(300, 3)))
    return shading(radiance, segment, rest, lights)


@pytest.mark.parametrize("outliers", [0, 60])
def test_gains_of_several_lights_and_colours(outliers: int) -> None:
    """Also where a fifth of the points shows something else, highlights or paint."""
    gains = np.array([[4.0, 5.0, 8.0], [30.0, 20.0, 10.0], [1.0, 1.0, 1.0]])
    seen = lit(gains, 0.05)
    rng = np.random.default_rng(1)
    spoilt = rng.permutation(300)[:outliers]
    seen.radiance[spoilt] *= rng.uniform(5.0, 10.0, (outliers, 1))
    found = clip_gains(seen, [], np.ones((3, 3), bool))
    np.testing.assert_allclose(found.gain[:2], gains[:2], rtol=0.2 if outliers else 0.1)
    assert (found.gain[2] < 2.0).all()
    assert (found.gain >= 1.0).all()


def test_channels_that_are_not_clipped_keep_their_light() -> None:
    gains = np.array([[6.0, 1.0, 1.0]])
    found = clip_gains(lit(gains, 0.02), [], np.array([[True, False, False]]))
    assert found.gain[0, 0] == pytest.approx(6.0, rel=0.2)
    assert (found.gain[0, 1:] == 1.0).all()


def test_energy_balance_tells_of_light_whose_shading_is_flattened() -> None:
    """Tone mapping evens out each white wall, whose shading then says that no light is missing."""
    true = lit(np.full((1, 3), 5.0), 0.0)
    received = true.rest + 5.0 * true.lights[..., 0]
    mean = np.stack([received[true.segment == number].mean(0) for number in range(10)])
    white = replace(true, radiance=0.85 / np.pi * mean[true.segment])
    found = clip_gains(white, [], np.ones((1, 3), bool))
    np.testing.assert_allclose(found.gain, 5.0, rtol=0.25)


@pytest.mark.parametrize("shine", [0.01, 0.1, 0.5])
def test_no_surface_reflects_more_than_it_receives(shine: float) -> None:
    """Single points, whose shading tells nothing: light must come from somewhere, and not more."""
    n = 40
    rng = np.random.default_rng(2)
    level = shine * 10.0 ** rng.uniform(-2.0, 0.0, (n, 1)) * np.ones((1, 3))
    rest, lights = np.full((n, 3), 0.05), np.full((n, 3, 1), 0.1)
    found = clip_gains(shading(level, np.arange(n), rest, lights), [], np.ones((1, 3), bool))
    reflectance = np.pi * level / (rest + lights[..., 0] * found.gain[0])
    assert reflectance.max() <= 1.4 * MAX_REFLECTANCE
    assert np.median(reflectance) >= 0.02
    assert (found.gain >= 1.0).all()
    assert (found.gain < 100.0).all()


def test_what_no_light_explains_stays_bounded() -> None:
    """A point that the light does not reach shines a million times as strong as it can."""
    seen = shading(np.full((5, 3), 1e6), np.arange(5), np.full((5, 3), 1e-3), np.zeros((5, 3, 1)))
    found = clip_gains(seen, [], np.ones((1, 3), bool))
    assert np.isfinite(found.gain).all()
    assert (found.gain >= 1.0).all()
    assert (found.gain <= MAX_GAIN).all()


def cells_of(frame: Frame, rows: int) -> Cells:
    return Cells.of(Geometry.of(frame, rows), rows)


def test_form_factors_of_a_closed_room_sum_up_to_pi() -> None:
    cells = cells_of(World().frame(128, 64), 64)
    inside = np.array([[0.3, -1.38, -0.5], [1.0, 0.2, -2.48], [-1.9, 1.0, 2.0]])
    normal = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    everything = np.arange(len(cells.depth))
    factors = form_factors(inside, normal, cells, everything, np.ones(len(everything)))
    np.testing.assert_allclose(factors.sum(1), np.pi, rtol=0.05)
    # From the middle of a ball, a cell's factor is its solid angle times the cosine.
    ball = cells_of(sphere_frame(2.0, 64, 32, 1.0), 32)
    up = np.array([[0.0, 1.0, 0.0]])
    factors = form_factors(np.zeros((1, 3)), up, ball, np.arange(2048), np.ones(2048))
    expected = ball.solid_angle * np.maximum(ball.direction[:, 1], 0.0)
    np.testing.assert_allclose(factors[0], expected, rtol=0.01, atol=1e-6)


@pytest.mark.parametrize(("height", "fine", "coarse"), [(64, 32, 8), (50, 32, 8), (50, 50, 32)])
def test_coarse_cells_are_the_same_by_way_of_finer_ones(
    height: int, fine: int, coarse: int
) -> None:
    """Whatever the number of texels in each."""
    frame = World().frame(2 * height, height)
    depth = frame.depth.copy()
    depth[3:9, 5:20] = np.inf
    frame = replace(frame, depth=depth)
    found, expected = Cells.of(Geometry.of(frame, fine), coarse), cells_of(frame, coarse)
    for name in ("depth", "sky", "opening"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), err_msg=name)
    sums = cell_sums(cell_sums(frame.color, fine), coarse)
    np.testing.assert_allclose(sums, cell_sums(frame.color, coarse))


def test_cells_add_up_the_texels_in_them() -> None:
    """By brute force; each texel belongs to one cell."""
    rows, height = 8, 50
    picture = np.random.default_rng(2).random((height, 2 * height))
    row, column = np.arange(height) * rows // height, np.arange(2 * height) * rows // height
    sums, texels = np.zeros((rows, 2 * rows)), np.zeros((rows, 2 * rows))
    np.add.at(sums, (row[:, None], column), picture)
    np.add.at(texels, (row[:, None], column), 1.0)
    np.testing.assert_allclose(cell_sums(picture, rows), sums)
    np.testing.assert_array_equal(cell_texels(picture.shape, rows), texels)
    np.testing.assert_allclose(cell_means(picture, rows), sums / texels)


def test_a_pillar_hides_what_is_behind_it() -> None:
    world = World(solids=(Box((0.0, -0.6, -1.2), (0.25, 0.8, 0.15)),))
    cells = cells_of(world.frame(256, 128), 128)
    rng = np.random.default_rng(4)
    chosen = rng.choice(len(cells.depth), 300, replace=False)
    start, ends = cells.point[chosen[:60]], cells.point[chosen[60:]]
    start = start + 0.05 * cells.normal[chosen[:60]]
    way = ends - start[:, None]
    far = np.linalg.norm(way, axis=-1)
    met, _, _ = world.first_hit(start[:, None] + 0.0 * way, way / far[..., None])
    free = met > 0.97 * far
    found = visible(cells, start, ends, 32)
    assert 0.02 < (~free).mean() < 0.5
    assert (found == free).mean() > 0.93
    assert found[free].mean() > 0.95
    assert (~found)[~free].mean() > 0.6


def test_of_large_panoramas_some_texels_say_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(solids=(Box((0.6, -1.2, -1.2), (0.4, 0.3, 0.3)),))
    frame = world.frame(512, 256)
    whole = cells_of(frame, 32)
    monkeypatch.setattr(gather, "NORMAL_ROWS", 64)
    assert sampled_normals(frame).shape == (64, 128, 3)
    monkeypatch.setattr(gather, "NORMAL_ROWS", 129)
    assert sampled_normals(frame) is frame.fitted_normal
    monkeypatch.setattr(gather, "NORMAL_ROWS", 64)
    some = cells_of(frame, 32)
    apart = (whole.normal * some.normal).sum(-1)
    assert (apart > 0.999)[whole.rough < 0.01].all()
    assert (apart > 0.99).mean() > 0.9
