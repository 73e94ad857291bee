"""The equirect mapping: its forms agree, and texels cover the sphere."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.equirect import (
    cell_towards,
    equirect_texel,
    solid_angles,
    texel_directions,
)

W, H = 96, 48


def test_solid_angles_cover_the_sphere() -> None:
    assert solid_angles(W, H).sum() * W == pytest.approx(4 * np.pi)


@pytest.mark.parametrize("rows", [slice(None), slice(7, 19)])
def test_directions_by_rows_and_columns_are_those_of_image_points(rows: slice) -> None:
    whole = View(W, H, projection="equirect").directions()
    found = np.stack(np.broadcast_arrays(*texel_directions(W, H, rows)), axis=-1)
    np.testing.assert_allclose(found, whole[rows], atol=1e-12)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_cells_are_the_texels_that_points_are_seen_in(dtype: type[np.floating]) -> None:
    rng = np.random.default_rng(5)
    point = rng.normal(size=(5000, 3)).astype(dtype)
    radius = np.linalg.norm(point, axis=-1).astype(dtype)
    row, column = equirect_texel(point.astype(np.float64), W, H)
    found = cell_towards(point, radius, H)
    # Rounding decides at the edges of cells alone.
    assert np.mean(found == row * W + column) > 0.999


def test_no_point_is_seen_outside_the_cells() -> None:
    point = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [-1e-30, 0, 1], [0, 0, 0]])
    cell = cell_towards(point, np.linalg.norm(point, axis=-1), H)
    assert ((cell >= 0) & (cell < H * W)).all()
