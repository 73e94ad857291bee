"""Kernel launches in parts, so that viewers on slow devices can abandon a frame.

A kernel that is known to be quick is enqueued as a whole. Other kernels start with a small part,
and its time sets the size of the next ones. Kernels need no change: a part is a launch with a
global offset, in which group indices and the number of groups refer to the part.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pyopencl import profiling_info

BAND_S = 0.05
"""Target for the seconds of work that are enqueued between two calls of `go_on`."""
QUICK_S = 0.005
"""Kernels that take less are enqueued as a whole."""
PARTS = 16
"""A kernel that is not known to be quick starts with 1 / PARTS of its grid."""
GROWTH = 4
"""Largest ratio of the sizes of consecutive parts."""

Key = tuple[str, str]
"""Names of a program and one of its kernels."""
Enqueue = Callable[[tuple[int, ...], tuple[int, ...]], Any]
"""Function that enqueues work items, given (offset, size), and returns the event."""


class Bands:
    """Launcher that splits slow kernels into parts, from the measured time of each kernel.

    Parameters
    ----------
    wait : callable
        Blocks until all enqueued work is done.
    go_on : callable
        Raises an exception to abandon the work under way.
    """

    def __init__(self, wait: Callable[[], None], go_on: Callable[[], None]) -> None:
        self._wait, self._go_on = wait, go_on
        self._item_s: dict[Key, float] = {}
        self._enqueued_s = 0.0
        self._unread: list[tuple[Key, int, Any]] = []

    def launch(
        self, key: Key, size: tuple[int, ...], local: tuple[int, ...], enqueue: Enqueue
    ) -> list[Any]:
        """Enqueue a kernel over `size` work items and return the events of its parts.

        `size` is a multiple of `local` in each dimension.

        Raises
        ------
        Exception
            Raised by `go_on`. Some parts may have run by then.
        """
        items = int(np.prod(size))
        expected = self._item_s.get(key, np.inf) * items
        if expected < QUICK_S:
            if self._enqueued_s + expected > BAND_S:
                self.look()
            event = enqueue((0,) * len(size), size)
            self._enqueued_s += expected
            self._unread.append((key, items, event))
            return [event]
        self.look()
        events = []
        groups = [n // m for n, m in zip(size, local, strict=True)]
        # Not along x: the work groups of a picture's row derive their columns from the group index.
        axis = max(range(1, len(groups)), key=groups.__getitem__, default=0)
        rows, row = groups[axis], local[axis]
        done, band = 0, max(rows // PARTS, 1)
        while done < rows:
            count = min(band, rows - done)
            begin = time.perf_counter()
            events.append(
                enqueue(
                    tuple(done * row * (i == axis) for i in range(len(size))),
                    tuple(count * row if i == axis else n for i, n in enumerate(size)),
                )
            )
            self.look()
            elapsed = max(time.perf_counter() - begin, 1e-6)
            done += count
            band = min(max(int(count * BAND_S / elapsed), 1), GROWTH * count)
        self._item_s[key] = sum(map(seconds, events)) / items
        return events

    def look(self) -> None:
        """Wait for the enqueued work, take its times and call `go_on`."""
        self._wait()
        for key, items, event in self._unread:
            self._item_s[key] = seconds(event) / items
        self._unread.clear()
        self._enqueued_s = 0.0
        self._go_on()


def seconds(event: Any) -> float:
    """Return the seconds that the device spent on a finished launch."""
    told = event.get_profiling_info
    return float(told(profiling_info.END) - told(profiling_info.START)) * 1e-9
