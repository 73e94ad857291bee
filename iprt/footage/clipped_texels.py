"""Texels of a picture in which lights were clipped, as the picture shows them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

WORD = 32
"""Texels whose bits share a word."""


@dataclass(frozen=True)
class ClippedTexels:
    """The colours of N texels of a panorama that shows them darker than they are.

    Attributes
    ----------
    texel : (N,) int32
        Row * width + column, ascending.
    color : (N, 3) float32
        Linear radiance as the picture shows it.
    """

    texel: NDArray[np.int32]
    color: NDArray[np.float32]

    def shown(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """The picture (H, W, 3) of which `light` is what surfaces send."""
        picture = light.copy()
        picture.reshape(-1, 3)[self.texel] = self.color
        return picture

    def repeated(self, factor: int, width: int) -> Self:
        """The same of a panorama, once `width` wide, whose texels are `factor` x `factor` now."""
        row, column = np.divmod(self.texel, width)
        steps = np.arange(factor)
        rows, columns = factor * row[:, None] + steps, factor * column[:, None] + steps
        texel = (rows[:, :, None] * factor * width + columns[:, None, :]).ravel()
        order = np.argsort(texel)
        return type(self)(
            texel[order].astype(np.int32), self.color.repeat(factor * factor, axis=0)[order]
        )

    def words(self, count: int) -> NDArray[np.uint32]:
        """(words, 2): which of `WORD` texels are among these, bit by bit, and how many are before.

        `count`: texels of the panorama.
        """
        words = -(-count // WORD)
        inside = np.zeros(words * WORD, bool)
        inside[self.texel] = True
        bits = np.packbits(inside, bitorder="little").view("<u4")
        before = np.searchsorted(self.texel, np.arange(0, words * WORD, WORD))
        return np.stack([bits, before.astype(np.uint32)], axis=-1)
