"""Launches in parts, so that work under way can be abandoned: what viewers need on slow devices.

A kernel that is known to be quick is enqueued as a whole. Of others a small part goes first; how
long that took tells how large the next parts are. Kernels know nothing of it: a part has a global
offset, and whatever a kernel makes of the number of its groups stays within the part.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pyopencl import profiling_info

BAND_S = 0.05
"""Longest work that is enqueued between two looks whether to go on, as far as that is known."""
QUICK_S = 0.005
"""Kernels that take less are enqueued as a whole."""
PARTS = 16
"""The first part of a kernel that is not known to be quick, as a share of it: 1 / PARTS."""
GROWTH = 4
"""Most times that a part is larger than the one before."""

Key = tuple[str, str]
"""Program and kernel."""
Enqueue = Callable[[tuple[int, ...], tuple[int, ...]], Any]
"""Enqueues (offset, size) work items; the event."""


class Bands:
    """Knows how long kernels take.

    Parameters
    ----------
    wait : callable
        Returns when all that is enqueued is done.
    go_on : callable
        Raises to end the work under way.
    """

    def __init__(self, wait: Callable[[], None], go_on: Callable[[], None]) -> None:
        self._wait, self._go_on = wait, go_on
        self._item_s: dict[Key, float] = {}
        self._enqueued_s = 0.0
        self._unread: list[tuple[Key, int, Any]] = []

    def launch(
        self, key: Key, size: tuple[int, ...], local: tuple[int, ...], enqueue: Enqueue
    ) -> list[Any]:
        """Enqueue a kernel over `size` work items, a multiple of `local`; the events of its parts.

        Raises
        ------
        Exception
            What `go_on` does; a part of the work is done then.
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
        # Work groups of a picture's row tell their columns by their number.
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
        """Wait for what is enqueued, and whether to go on."""
        self._wait()
        for key, items, event in self._unread:
            self._item_s[key] = seconds(event) / items
        self._unread.clear()
        self._enqueued_s = 0.0
        self._go_on()


def seconds(event: Any) -> float:
    """Seconds that the device spent on a launch, which is done."""
    told = event.get_profiling_info
    return float(told(profiling_info.END) - told(profiling_info.START)) * 1e-9
