"""Arguments of kernels that work on several layers or signals at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

from pyopencl import cltypes

Rect = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1, as (x0, y0, x1, y1)."""

GRID = 16
"""Pixels by which rectangles grow: they stay the same while objects move little."""


@lru_cache(maxsize=256)
def int4(rect: Rect) -> Any:
    """A rectangle as kernels take it; of the same one, the same object."""
    return cltypes.make_int4(*rect)


def enlarged(rect: Rect, size: tuple[int, int]) -> Rect:
    """The rectangle, enlarged to a grid of `GRID` pixels, within a picture of `size`."""
    x0, y0, x1, y1 = rect
    width, height = size
    return (
        x0 - x0 % GRID,
        y0 - y0 % GRID,
        min(x1 + -x1 % GRID, width),
        min(y1 + -y1 % GRID, height),
    )


def size_over(rects: Sequence[Rect], group: Sequence[int]) -> tuple[int, int]:
    """Work items of a launch over several rectangles (`BATCH_ITEM`), in groups of that size."""
    groups = sum(
        max(-(-(x1 - x0) // group[0]), 0) * max(-(-(y1 - y0) // group[1]), 0)
        for x0, y0, x1, y1 in rects
    )
    return groups * group[0], group[1]


def batched(**values: Sequence[Any]) -> dict[str, Any]:
    """`BATCHED` parameters of `cl/lib/gbuffer/batch.h`: one value of each for every entry."""
    given: dict[str, Any] = {}
    for name, entries in values.items():
        given.update(zip(_names(name, len(entries)), entries, strict=True))
    return given


@cache
def _names(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}_{i}" for i in range(count))
