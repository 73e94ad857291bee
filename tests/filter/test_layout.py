"""The layout of planes."""

import numpy as np
import pytest

from iprt.gbuffer.layout import PAD, PlaneLayout

LINE, SETS = 64, 64
"""Bytes of a cache line, and the sets of an L1 data cache of 4 KiB a way (x86 and Arm)."""


@pytest.mark.parametrize("size", [(512, 512), (1024, 512), (500, 500), (64, 48), (33, 1), (1, 7)])
def test_sixteen_planes_share_no_set_of_the_cache(size: tuple[int, int]) -> None:
    _, floats = PlaneLayout(*size).shape(16)
    lines = np.arange(16) * floats * 4 // LINE
    assert len(set(lines % SETS)) == 16


@pytest.mark.parametrize("size", [(500, 500), (64, 48), (1, 7)])
def test_borders_are_apart(size: tuple[int, int]) -> None:
    width, height = size
    layout = PlaneLayout(width, height)
    image = np.arange(3.0 * width * height).reshape(3, height, width) + 1.0
    planes = layout.padded(image)
    assert planes.shape == layout.shape(3)
    assert np.array_equal(layout.interior(planes), image)
    bordered = layout.bordered(planes)
    assert bordered.shape == (3, height + 2 * PAD, width + 2 * PAD)
    assert np.array_equal(bordered, np.pad(image, [(0, 0), (PAD, PAD), (PAD, PAD)]))
    assert np.count_nonzero(planes) == image.size
