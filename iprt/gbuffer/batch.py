"""Arguments of kernels that work on several layers or signals at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

from iprt.device.kernel_source import constant

MOST_ENTRIES = constant("lib/gbuffer/batch.h", "MOST_ENTRIES")


def batched(**values: Sequence[Any]) -> dict[str, Any]:
    """Return parameters `name[MOST_ENTRIES]` of kernels from one value per entry each.

    Missing entries of a smaller batch are bound to the first one's.
    """
    given: dict[str, Any] = {}
    for name, entries in values.items():
        lacking = MOST_ENTRIES - len(entries)
        given.update(zip(_names(name), (*entries, *[entries[0]] * lacking), strict=True))
    return given


@cache
def _names(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{i}" for i in range(MOST_ENTRIES))
