"""A device that counts what kernels have to do: rays, steps, and work items with something to do.

Kernels that declare `WORK_PARAMETER` (`cl/lib/maths/work.h`) are built once more, with counters,
which cost time: `iprt profile` counts in frames that it does not time. Pictures are the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import DTypeLike

from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel, KernelWrapper
from iprt.device.profile import Profile
from iprt.device.program import Define
from iprt.files.resources import CL

COUNTERS = 9
"""Counters of one launch, see `cl/lib/maths/work.h`."""


@dataclass(frozen=True)
class Rays:
    """Rays of one kind, and the steps of their marches.

    Attributes
    ----------
    count : int
    steps : int
        Steps of all: cells of the pyramid; nodes, packets and instances of the hierarchy.
    most_steps : int
        Steps of the longest march.
    """

    count: int = 0
    steps: int = 0
    most_steps: int = 0

    def __add__(self, other: Rays) -> Rays:
        most = max(self.most_steps, other.most_steps)
        return Rays(self.count + other.count, self.steps + other.steps, most)


@dataclass(frozen=True)
class Work:
    """Work of a kernel's launches.

    Attributes
    ----------
    items, active : int
        Work items that were asked for, and those with something to do. A kernel that works through
        a list is launched for the longest that there can be.
    groups, active_groups : int
        Work groups, and those with such items, which come first.
    real, objects : Rays
        Through the panorama, and towards objects.
    """

    items: int = 0
    active: int = 0
    groups: int = 0
    active_groups: int = 0
    real: Rays = Rays()
    objects: Rays = Rays()

    def __add__(self, other: Work) -> Work:
        return Work(
            self.items + other.items,
            self.active + other.active,
            self.groups + other.groups,
            self.active_groups + other.active_groups,
            self.real + other.real,
            self.objects + other.objects,
        )


class CountingDevice(ComputeDevice):
    """Shares everything with `device` but the profile, and counts.

    Attributes
    ----------
    work : dict of (str, str) to Work
        By pass and kernel, summed; empty it to begin anew.
    """

    def __init__(self, device: ComputeDevice) -> None:
        vars(self).update(vars(device))
        self._inside = device
        self.profile = Profile()
        self.work: dict[tuple[str, str], Work] = {}
        self._counters = cla.zeros(self.queue, COUNTERS, np.uint32)

    def kernel(
        self,
        file: str,
        name: str,
        defines: Mapping[str, Define] | None = None,
        **hints: Any,
    ) -> Kernel:
        if "WORK_PARAMETER" in (CL / file).read_text():
            defines = {**(defines or {}), "COUNT_WORK": True}
        kernel = self._inside.kernel(file, name, defines, **hints)
        kernel.run_on(self)  # whose profile is another
        return CountingKernel(self, kernel)

    def empty(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        return self._inside.empty(name, shape, dtype)

    def counted(self, size: tuple[int, ...]) -> Work:
        """Work of the launch over `size` that was enqueued last."""
        active, *rays = map(int, self.read(self._counters))
        real, objects = (
            Rays(count, low + (high << 32), most) for count, low, high, most in (rays[:4], rays[4:])
        )
        local = self.group_size(len(size))
        items = math.prod(size)
        groups = math.prod(-(-n // m) for n, m in zip(size, local, strict=True))
        filled = groups if active == items else -(-active // math.prod(local))
        return Work(items, active, groups, filled, real, objects)


class CountingKernel(KernelWrapper):
    """A kernel whose work is counted, if it counts."""

    def __init__(self, device: CountingDevice, kernel: Kernel) -> None:
        super().__init__(kernel)
        self._counting = device

    def __call__(self, size: tuple[int, ...], *groups: Mapping[str, Any], **own: Any) -> None:
        device = self._counting
        if "work" not in self.parameters:  # beside others that count
            super().__call__(size, *groups, **own)
            return
        device.fill_zero(device._counters)
        super().__call__(size, *groups, **own, work=device._counters)
        key = (device.profile.current, self.name)
        device.work[key] = device.work.get(key, Work()) + device.counted(size)
