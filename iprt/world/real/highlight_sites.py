"""Texels at which the lobes of glossy real surfaces are sampled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.device.kernel_source import float_constant
from iprt.geometry.material import Material

BLOCKS = 2.4
"""Blocks per width of a lobe, as the filter sees it."""
WIDEST = 8
"""Widest block in texels."""
LOBE_FRACTION = float_constant("world/real/highlight.cl", "LOBE_FRACTION")


@dataclass(frozen=True)
class SiteLayout:
    """Blocks of each glossy material, as wide as its lobe allows.

    Attributes
    ----------
    table : (materials, 4) int32
        First block, columns, rows of blocks, and their side in texels; 0 where the whole radiance
        is reflection, of which no sample is needed.
    blocks : int
        Number of blocks of all materials.
    """

    table: NDArray[np.int32]
    blocks: int

    @classmethod
    def of(cls, materials: Sequence[Material], width: int, height: int) -> SiteLayout:
        """Return the layout for a panorama of this size."""
        table = np.zeros((len(materials), 4), np.int32)
        end = 0
        for row, material in zip(table, materials, strict=True):
            if material.kind != "plastic":
                continue
            side = block_side(material.alpha, height)
            columns, rows = -(-width // side), -(-height // side)
            row[:] = end, columns, rows, side
            end += columns * rows
        return cls(table, end)

    def sites(self, gloss: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return a texel (blocks,) of each block that shows its material; -1: none does.

        It is near the block's middle.

        Parameters
        ----------
        gloss : (H, W) int
            `Frame.gloss`.
        """
        width = gloss.shape[1]
        texels = np.full(self.blocks, -1, np.int32)
        for index, (first, columns, rows, side) in enumerate(self.table):
            if not side:
                continue
            own = texels[first : first + columns * rows].reshape(rows, columns)
            for down, aside in _from_the_middle(side):
                there = gloss[down::side, aside::side] == index + 1
                row, column = np.nonzero(there & (own[: there.shape[0], : there.shape[1]] < 0))
                own[row, column] = (row * side + down) * width + column * side + aside
        return texels


def _from_the_middle(side: int) -> list[tuple[int, int]]:
    """Return (row, column) of a block's texels, from its middle outwards."""
    at = [(down, aside) for down in range(side) for aside in range(side)]
    return sorted(at, key=lambda one: sum(abs(2 * place + 1 - side) for place in one))


def block_side(alpha: float, height: int) -> int:
    """Return the side of blocks, a power of two, for a lobe's roughness."""
    width = 2.0 * LOBE_FRACTION * height / np.pi * alpha
    return int(min(WIDEST, 2 ** max(0, math.floor(math.log2(max(width / BLOCKS, 1.0))))))
