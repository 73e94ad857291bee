"""Host memory: huge pages for the buffers of a CPU, and how the C library keeps freed memory."""

from __future__ import annotations

import ctypes
import itertools
import mmap
from collections import defaultdict
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

HUGE_PAGE = 1 << 21
"""Bytes of a huge page."""
LARGE = HUGE_PAGE // 2
"""Bytes from which an array lies in huge pages of its own, where the system has them."""
MOST_SPARE = 1 << 25
"""Most bytes of released pages that are kept for other arrays."""
MMAP_THRESHOLD, RETURNED = -3, 1 << 20
"""Parameter of the C library's `mallopt`, and bytes from which it returns freed memory at once."""
LINE, STARTS = 64, 1024
"""Bytes of a cache's line, and lines at which large arrays start in turn."""


class HostMemory:
    """Arrays in pages of their own, for buffers that use the host's memory.

    Large arrays ask for huge pages: addresses are translated faster. Each then starts at another
    line of the caches. Huge pages would keep all starts in one set of lines, and the planes of a
    pixel would displace each other. Released pages serve other arrays of about the same size: the
    system clears new ones first.
    """

    def __init__(self) -> None:
        # Those made one after another, such as the planes of a signal, start far apart.
        self._starts = itertools.cycle(LINE * (67 * i % STARTS) for i in range(STARTS))
        self._used: dict[int, tuple[mmap.mmap, int]] = {}
        self._spare: defaultdict[int, list[tuple[mmap.mmap, int]]] = defaultdict(list)
        self._spare_bytes = 0

    def array(self, shape: tuple[int, ...], dtype: DTypeLike, *, zeros: bool) -> NDArray[Any]:
        """Return an array, of zeros or of any values. New pages take no memory before a write."""
        kind, count = np.dtype(dtype), int(np.prod(shape))
        room = _room(count * kind.itemsize)
        reused = bool(self._spare[room])
        if reused:
            pages, start = self._spare[room].pop()
            self._spare_bytes -= room
        else:
            pages, start = _mapped(room), next(self._starts) if room >= LARGE else 0
        values = np.frombuffer(pages, kind, count, start).reshape(shape)
        if reused and zeros:
            values[...] = 0
        self._used[id(values)] = (pages, start)
        return values

    def release(self, values: NDArray[Any]) -> None:
        """Take back an array from `array`, which nothing uses any more. Others are ignored."""
        pages, start = self._used.pop(id(values), (None, 0))
        if pages is not None and LARGE <= len(pages) <= MOST_SPARE - self._spare_bytes:
            self._spare[len(pages)].append((pages, start))
            self._spare_bytes += len(pages)

    def discard(self, values: NDArray[Any]) -> None:
        """Give the memory of an array from `array` to the system; its values are lost."""
        self._used[id(values)][0].madvise(mmap.MADV_DONTNEED)


def _room(size: int) -> int:
    """Return the bytes to map for an array."""
    if size < LARGE or not hasattr(mmap, "MADV_HUGEPAGE"):
        return size
    used = size + LINE * STARTS
    # A last huge page that would be less than half full would waste memory.
    return max(used, (used + HUGE_PAGE // 2) // HUGE_PAGE * HUGE_PAGE)


def _mapped(room: int) -> mmap.mmap:
    """Return new pages, which are huge if they are many."""
    pages = mmap.mmap(-1, room, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if room >= LARGE and hasattr(mmap, "MADV_HUGEPAGE"):
        with suppress(OSError):  # a kernel without them
            pages.madvise(mmap.MADV_HUGEPAGE)
    return pages


def return_freed_memory() -> None:
    """Let the C library return each large array to the system when it is freed, if it is glibc.

    Otherwise it raises its threshold to 32 MB with the arrays that are freed, and keeps many of
    them: hundreds of megabytes in a viewer.
    """
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, RETURNED)
