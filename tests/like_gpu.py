"""A device that is taken for one that is no CPU, and tells what the host does beside kernels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import numpy as np
import pyopencl as cl

from iprt.device.compute import ComputeDevice


class LikeGpu(ComputeDevice):
    """Any device, with all that depends on it being a CPU done otherwise."""

    @property
    def is_cpu(self) -> bool:
        return False


@dataclass
class Traffic:
    """Actions of the host.

    Attributes
    ----------
    uploads, reads : list of int
        Bytes of each transfer to and from the device.
    waits : int
    """

    uploads: list[int] = field(default_factory=list)
    reads: list[int] = field(default_factory=list)
    waits: int = 0


@contextmanager
def traffic() -> Iterator[Traffic]:
    """All of it meanwhile, on any device, at pyopencl: nothing goes past it."""
    seen = Traffic()
    copy = cl.enqueue_copy

    def record(queue: Any, to: Any, source: Any, **rest: Any) -> Any:
        for end, sizes in ((to, seen.reads), (source, seen.uploads)):
            if isinstance(end, np.ndarray):
                sizes.append(end.nbytes)
        if rest.get("is_blocking", True):
            seen.waits += 1
        return copy(queue, to, source, **rest)

    def wait(*_: Any) -> None:
        seen.waits += 1

    with (
        mock.patch.object(cl, "enqueue_copy", record),
        mock.patch.object(cl, "enqueue_map_buffer", side_effect=AssertionError),
        mock.patch.object(cl.CommandQueue, "finish", wait),
        mock.patch.object(cl, "enqueue_marker", side_effect=AssertionError),
        mock.patch.object(cl.Event, "wait", wait),
    ):
        yield seen
