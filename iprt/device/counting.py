"""A device that counts the work of kernels: rays, march steps and active work items.

Kernels that take `const Work work` (`cl/lib/maths/work_counters.h`) are built a second time with
counters. Counting takes time, so `iprt profile` counts in frames that it does not time. Pictures
are the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import DTypeLike

from iprt.device.block import Block, Counters, when
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel, KernelWrapper
from iprt.device.profile import Profile
from iprt.device.program import Define
from iprt.files.resources import CL

COUNTERS = 9
"""Number of counters of a launch; see `cl/lib/maths/work_counters.h`."""


@dataclass(frozen=True)
class Rays:
    """Counts of one kind of rays and their march steps.

    Attributes
    ----------
    count : int
        Number of rays.
    steps : int
        Steps of all rays: cells of the depth pyramid; nodes, packets and instances of the BVH.
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
        Launched work items, and the ones with work to do. A kernel over a list is launched for the
        list's largest possible length.
    groups, active_groups : int
        Launched work groups, and the ones with active items, which come first.
    real, objects : Rays
        Rays through the panorama, and rays towards objects.
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


@dataclass(kw_only=True)
class WorkArgs(Block):
    """Counters of a launch.

    Attributes
    ----------
    counters : (COUNTERS,) uint32
    """

    counters: Counters = when("COUNT_WORK")


class CountingDevice(ComputeDevice):
    """Counting view of a device, which shares everything with it except the profile.

    Attributes
    ----------
    work : dict of (str, str) to Work
        Summed work by pass and kernel. Clear it to count from zero.
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
        """Return a kernel that counts its work, if it takes `const Work work`."""
        if "const Work work" in (CL / file).read_text():
            defines = {**(defines or {}), "COUNT_WORK": True}
        kernel = self._inside.kernel(file, name, defines, **hints)
        kernel.run_on(self)  # records in this device's profile
        return CountingKernel(self, kernel)

    def empty(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        """Allocate an uninitialised buffer of the inner device."""
        return self._inside.empty(name, shape, dtype)

    def zeros(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        """Allocate a buffer of zeros of the inner device."""
        return self._inside.zeros(name, shape, dtype)

    def counted(self, size: tuple[int, ...]) -> Work:
        """Return the work of the last launch, which was over `size` work items."""
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
    """Wrapper that adds the work of each launch to the device's counts."""

    def __init__(self, device: CountingDevice, kernel: Kernel) -> None:
        super().__init__(kernel)
        self._counting = device

    def __call__(self, size: tuple[int, ...], *groups: Mapping[str, Any], **own: Any) -> None:
        """Enqueue the kernel and add its work to the device's counts."""
        device = self._counting
        if "work_counters" not in self.parameters:  # a kernel without counters
            super().__call__(size, *groups, **own)
            return
        device.fill_zero(device._counters)
        super().__call__(size, *groups, **own, work_counters=device._counters)
        key = (device.profile.current, self.name)
        device.work[key] = device.work.get(key, Work()) + device.counted(size)
