"""Texels that a picture shows clipped: kept sparsely, found again bit by bit."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.clipped_texels import WORD, ClippedTexels

SIZES = [(2, 1), (16, 8), (37, 23)]
"""The last has words that are not full, across rows."""
SHARES = [0.0, 0.3, 1.0]


def picture(size: tuple[int, int]) -> NDArray[np.float32]:
    return np.random.default_rng(size[0]).random((size[1], size[0], 3)).astype(np.float32)


def some(size: tuple[int, int], share: float) -> ClippedTexels:
    chosen = np.random.default_rng(1).random(size[0] * size[1]) < share
    texel = np.flatnonzero(chosen).astype(np.int32)
    return ClippedTexels(texel, picture(size).reshape(-1, 3)[texel])


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("share", SHARES)
def test_the_picture_comes_back(size: tuple[int, int], share: float) -> None:
    seen, clipped = picture(size), some(size, share)
    light = seen.copy()
    light.reshape(-1, 3)[clipped.texel] *= 10.0
    before = light.copy()
    np.testing.assert_array_equal(clipped.shown(light), seen)
    np.testing.assert_array_equal(light, before)


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("share", SHARES)
def test_words_number_the_texels(size: tuple[int, int], share: float) -> None:
    clipped, count = some(size, share), size[0] * size[1]
    words = clipped.words(count)
    assert len(words) == -(-count // WORD)
    found = []
    for texel in range(count):
        bits, before = (int(part) for part in words[texel // WORD])
        if bits >> texel % WORD & 1:
            below = bits & ((1 << texel % WORD) - 1)
            assert before + below.bit_count() == len(found)
            found.append(texel)
    np.testing.assert_array_equal(found, clipped.texel)


@pytest.mark.parametrize("factor", [1, 3])
def test_repeated_texels_are_those_of_the_repeated_picture(factor: int) -> None:
    size = 5, 4
    clipped = some(size, 0.4)
    wide = clipped.repeated(factor, size[0])
    assert (np.diff(wide.texel) > 0).all()
    light = np.zeros((4, 5, 3), np.float32)
    wanted = clipped.shown(light).repeat(factor, axis=0).repeat(factor, axis=1)
    found = wide.shown(light.repeat(factor, axis=0).repeat(factor, axis=1))
    np.testing.assert_array_equal(found, wanted)
