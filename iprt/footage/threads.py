"""Parallel work in threads: NumPy and SciPy release the interpreter lock while they compute."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Made = TypeVar("Made")


def on_all_cores(function: Callable[[Item], Made], items: Iterable[Item]) -> list[Made]:
    """Map a function over items, with one thread per core; results are in the items' order.

    Errors from the function propagate.
    """
    with ThreadPoolExecutor(os.cpu_count(), "iprt cores") as pool:
        return list(pool.map(function, items))
