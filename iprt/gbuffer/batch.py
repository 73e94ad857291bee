"""Arguments of kernels that work on several layers or signals at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

from pyopencl import cltypes

Rect = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1, as (x0, y0, x1, y1)."""


@lru_cache(maxsize=256)
def int4(rect: Rect) -> Any:
    """A rectangle as kernels take it; of the same one, the same object."""
    return cltypes.make_int4(*rect)


def batched(**values: Sequence[Any]) -> dict[str, Any]:
    """`BATCHED` parameters of `cl/lib/gbuffer/batch.h`: one value of each for every entry."""
    given: dict[str, Any] = {}
    for name, entries in values.items():
        given.update(zip(_names(name, len(entries)), entries, strict=True))
    return given


@cache
def _names(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}_{i}" for i in range(count))
