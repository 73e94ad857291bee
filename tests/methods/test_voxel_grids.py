"""Where voxels are: grids around boxes, and the box of the room."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.methods.voxels import fitted_grid, room_box
from tests.worlds import sphere_frame


def test_grids_hold_their_box() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        low = rng.normal(size=3)
        high = low + 10.0 ** rng.uniform(-4.0, 1.0, 3)
        grid = fitted_grid(low, high, 32)
        size = np.array(grid.size)
        assert size.prod() <= 32**3
        assert (grid.low <= low - 1.5 * grid.voxel).all()
        assert (grid.low + grid.voxel * size >= high + 1.5 * grid.voxel).all()
    assert fitted_grid(np.zeros(3), np.ones(3), 64).voxel == pytest.approx(1.0 / 60.0, rel=0.1)


def test_the_room_is_where_most_surfaces_are() -> None:
    frame = sphere_frame(2.0, 128, 64, 1.0)
    low, high = room_box(frame.depth, 2.0)
    np.testing.assert_allclose([-low, high], 2.0, rtol=0.05)
    far = frame.depth.copy()
    far[:, 60:64] = 1e4
    low, high = room_box(far, 2.0)
    assert max(-low.min(), high.max()) <= 6.0
    nothing = np.full_like(far, np.inf)
    np.testing.assert_array_equal(room_box(nothing, 0.0), [-np.ones(3), np.ones(3)])
