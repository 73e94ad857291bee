"""Arguments of kernels that work on several layers or signals at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from pyopencl import cltypes

Rect = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1, as (x0, y0, x1, y1)."""


@lru_cache(maxsize=256)
def int4(rect: Rect) -> Any:
    """A rectangle as kernels take it; of the same one, the same object."""
    return cltypes.make_int4(*rect)


def size_over(rects: Sequence[Rect], group: Sequence[int]) -> tuple[int, int]:
    """Work items of a launch over several rectangles (`BATCH_ITEM`), in groups of that size."""
    groups = sum(
        max(-(-(x1 - x0) // group[0]), 0) * max(-(-(y1 - y0) // group[1]), 0)
        for x0, y0, x1, y1 in rects
    )
    return groups * group[0], group[1]


def batched(**values: Sequence[Any]) -> dict[str, Any]:
    """`BATCHED` parameters of `cl/lib/gbuffer/batch.h`: one value of each for every entry."""
    return {f"{name}_{i}": value for name, of in values.items() for i, value in enumerate(of)}
