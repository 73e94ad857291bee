"""Form factors and visibility of cells, in rooms that are known."""

from __future__ import annotations

import numpy as np

from iprt.footage.form_factors import form_factors, visible
from tests.footage.test_cells import cells_of
from tests.oracles.worlds import Box, World
from tests.worlds import sphere_frame


def test_form_factors_of_a_closed_room_sum_up_to_pi() -> None:
    cells = cells_of(World().frame(128, 64), 64)
    inside = np.array([[0.3, -1.38, -0.5], [1.0, 0.2, -2.48], [-1.9, 1.0, 2.0]])
    normal = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    factors = form_factors(inside, normal, cells.point, cells.normal, cells.area)
    np.testing.assert_allclose(factors.sum(1), np.pi, rtol=0.05)
    # From the middle of a ball, a cell's factor is its solid angle times the cosine.
    ball = cells_of(sphere_frame(2.0, 64, 32, 1.0), 32)
    up = np.array([[0.0, 1.0, 0.0]])
    factors = form_factors(np.zeros((1, 3)), up, ball.point, ball.normal, ball.area)
    expected = ball.solid_angle * np.maximum(ball.direction[:, 1], 0.0)
    np.testing.assert_allclose(factors[0], expected, rtol=0.01, atol=1e-6)


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
