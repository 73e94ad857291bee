"""Vectors as kernel arguments."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from pyopencl import cltypes


@lru_cache(maxsize=256)
def int4(values: tuple[int, int, int, int]) -> Any:
    """Return four numbers as a kernel argument; equal ones give the same object, which is bound."""
    return cltypes.make_int4(*values)
