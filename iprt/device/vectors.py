"""Vectors as kernel arguments."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from pyopencl import cltypes


@lru_cache(maxsize=256)
def int4(values: tuple[int, int, int, int]) -> Any:
    """Return four numbers as a kernel argument; equal ones give the same object, which is bound."""
    return cltypes.make_int4(*values)


@lru_cache(maxsize=256)
def float2(x: float, y: float) -> Any:
    """Return two numbers as a kernel argument, as `int4`."""
    return cltypes.make_float2(x, y)


@lru_cache(maxsize=256)
def float4(values: tuple[float, float, float, float]) -> Any:
    """Return four numbers as a kernel argument, as `int4`."""
    return cltypes.make_float4(*values)
