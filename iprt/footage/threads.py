"""Work on all cores by threads: NumPy and SciPy let others run while they compute."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Made = TypeVar("Made")


def on_all_cores(function: Callable[[Item], Made], items: Iterable[Item]) -> list[Made]:
    """Call a function of each item, on a thread per core; the results are in the items' order.

    An error of the function is raised here.
    """
    with ThreadPoolExecutor(os.cpu_count(), "iprt cores") as pool:
        return list(pool.map(function, items))
