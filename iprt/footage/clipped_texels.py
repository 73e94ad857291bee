"""Texels with clipped lights, in the picture's own colors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

WORD = 32
"""Number of texels per bit mask."""


@dataclass(frozen=True)
class ClippedTexels:
    """The stored colors of N texels of a panorama whose radiance for rays is another.

    The camera clipped it, or they show a sun that is a light of its own.

    Attributes
    ----------
    texel : (N,) int32
        Row * width + column, ascending.
    color : (N, 3) float32
        Linear radiance as stored in the picture.
    """

    texel: NDArray[np.int32]
    color: NDArray[np.float32]

    def with_others(self, others: Self) -> Self:
        """Return both, in order; where both hold a texel, the color stays."""
        new = ~np.isin(others.texel, self.texel)
        texel = np.concatenate([self.texel, others.texel[new]])
        order = np.argsort(texel)
        return type(self)(texel[order], np.concatenate([self.color, others.color[new]])[order])

    def shown(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the picture (H, W, 3) as stored, from the recovered radiance `light`."""
        picture = light.copy()
        picture.reshape(-1, 3)[self.texel] = self.color
        return picture

    def repeated(self, factor: int, width: int) -> Self:
        """Return the texels of a panorama enlarged by repeating each `factor` x `factor` times.

        `width` is the width before.
        """
        row, column = np.divmod(self.texel, width)
        steps = np.arange(factor)
        rows, columns = factor * row[:, None] + steps, factor * column[:, None] + steps
        texel = (rows[:, :, None] * factor * width + columns[:, None, :]).ravel()
        order = np.argsort(texel)
        return type(self)(
            texel[order].astype(np.int32), self.color.repeat(factor * factor, axis=0)[order]
        )

    def words(self, count: int) -> NDArray[np.uint32]:
        """Return bit masks (words, 2) of `WORD` texels, each with the number of members before it.

        `count` is the number of texels of the panorama.
        """
        words = -(-count // WORD)
        inside = np.zeros(words * WORD, bool)
        inside[self.texel] = True
        bits = np.packbits(inside, bitorder="little").view("<u4")
        before = np.searchsorted(self.texel, np.arange(0, words * WORD, WORD))
        return np.stack([bits, before.astype(np.uint32)], axis=-1)
