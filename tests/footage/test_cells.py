"""Cells of a panorama: what they add up, and that coarser ones say the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.footage import cells as module
from iprt.footage.cells import Cells, Geometry, cell_means, cell_sums, cell_texels, sampled_normals
from iprt.footage.frame import Frame
from tests.oracles.worlds import Box, World


def cells_of(frame: Frame, rows: int) -> Cells:
    return Cells.of(Geometry.of(frame, rows), rows)


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


def test_of_large_panoramas_some_texels_say_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(solids=(Box((0.6, -1.2, -1.2), (0.4, 0.3, 0.3)),))
    frame = world.frame(512, 256)
    whole = cells_of(frame, 32)
    monkeypatch.setattr(module, "NORMAL_ROWS", 64)
    assert sampled_normals(frame).shape == (64, 128, 3)
    monkeypatch.setattr(module, "NORMAL_ROWS", 129)
    assert sampled_normals(frame) is frame.fitted_normal
    monkeypatch.setattr(module, "NORMAL_ROWS", 64)
    some = cells_of(frame, 32)
    apart = (whole.normal * some.normal).sum(-1)
    assert (apart > 0.999)[whole.rough < 0.01].all()
    assert (apart > 0.99).mean() > 0.9
