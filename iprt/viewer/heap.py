"""Memory that was freed goes back to the system."""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Callable
from functools import cache


def give_back() -> None:
    """Let other programs have what this one has freed.

    The C library keeps freed buffers of a few megabytes for itself, ever more of them as pictures
    of other sizes are made. Those of devices that are processors are among them.
    """
    gc.collect()
    _trim()(0)


@cache
def _trim() -> Callable[[int], object]:
    """glibc's function; one that does nothing elsewhere."""
    try:
        found: Callable[[int], object] = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return lambda _: None
    return found
