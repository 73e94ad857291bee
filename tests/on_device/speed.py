"""Bandwidth of memory and of the bus, and what a launch costs, each measured once."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np
import pyopencl as cl

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from tests.on_device.cases import Asked, Cases, Row

SOURCE = """
__kernel void copy1(__global const float *from, __global float *to)
{ to[get_global_id(0)] = from[get_global_id(0)]; }
__kernel void copy4(__global const float4 *from, __global float4 *to)
{ to[get_global_id(0)] = from[get_global_id(0)]; }
__kernel void nothing(__global float *to) {}
"""
LARGEST, LARGEST_OF_CPU = 1 << 30, 1 << 27
"""Bytes of a buffer to copy: far more than caches hold."""
MOVED = 1 << 26
"""Bytes to move over the bus."""
ROUNDS, QUEUED = 9, 1000


def cases(asked: Asked) -> Cases:
    """Each of them."""
    bench = _Bench(ComputeDevice(choose_device(asked.device)))
    return {
        "copy": bench.copies,
        "launch": bench.launches,
        "bus": bench.transfers,
    }


class _Bench:
    """Kernels of `SOURCE` on a device."""

    def __init__(self, device: ComputeDevice) -> None:
        self._device = device
        self._queue = device.queue
        self._program = cl.Program(device.context, SOURCE).build()

    def copies(self) -> list[Row]:
        """Bytes read and written by the device's own clock, for floats and for four at a time."""
        device = self._device
        size = LARGEST_OF_CPU if device.is_cpu else LARGEST
        size = min(size, device.memory // 8, device.largest_buffer) // 4096 * 4096
        one, other = (cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size) for _ in range(2))
        rows: list[Row] = []
        cl.enqueue_fill_buffer(self._queue, one, np.uint8(1), 0, size)
        for name, width in (("copy1", 4), ("copy4", 16)):
            kernel = cl.Kernel(self._program, name)
            group = (64,) if device.is_cpu else (256,)

            def launch(
                kernel: cl.Kernel = kernel, width: int = width, group: tuple[int, ...] = group
            ) -> cl.Event:
                return kernel(self._queue, (size // width,), group, one, other)

            seconds = self._of_events(launch)
            rows.append({"what": f"{width} bytes an item", "GB/s": 2e-9 * size / seconds})
        rows[0]["buffer MiB"] = size >> 20
        return rows

    def transfers(self) -> list[Row]:
        """Pageable memory, by the clock, as pictures come and go."""
        host = np.ones(MOVED, np.uint8)
        buffer = cl.Buffer(self._device.context, cl.mem_flags.READ_WRITE, MOVED)
        ways = {
            "to the device": lambda: cl.enqueue_copy(self._queue, buffer, host),
            "from the device": lambda: cl.enqueue_copy(self._queue, host, buffer),
        }
        return [{"what": name, "GB/s": 1e-9 * MOVED / self._clocked(w)} for name, w in ways.items()]

    def launches(self) -> list[Row]:
        """An empty kernel: waited for each time, and many in a queue."""
        buffer = cl.Buffer(self._device.context, cl.mem_flags.READ_WRITE, 4096)
        kernel = cl.Kernel(self._program, "nothing")
        kernel.set_args(buffer)
        enqueued: list[float] = []
        between: list[float] = []

        def launch() -> cl.Event:
            return cl.enqueue_nd_range_kernel(self._queue, kernel, (128,), (64,))

        def many() -> None:
            start = time.perf_counter()
            events = [launch() for _ in range(QUEUED)]
            enqueued.append(time.perf_counter() - start)
            self._queue.finish()
            taken = events[-1].profile.end - events[0].profile.start
            between.append(1e-9 * taken)

        alone = self._clocked(launch)
        queued = self._clocked(many) / QUEUED
        return [
            {"what": "one, waited for", "us": 1e6 * alone},
            {"what": f"each of {QUEUED}, by the clock", "us": 1e6 * queued},
            {"what": f"each of {QUEUED}, to enqueue", "us": 1e6 * median(enqueued) / QUEUED},
            {"what": f"each of {QUEUED}, on the device", "us": 1e6 * median(between) / QUEUED},
            {"what": "one, start to end", "us": 1e6 * self._of_events(launch)},
        ]

    def _of_events(self, launch: Callable[[], cl.Event]) -> float:
        """Median seconds from start to end."""
        times = []
        for _ in range(ROUNDS):
            event = launch()
            event.wait()
            times.append(1e-9 * (event.profile.end - event.profile.start))
        return median(times[1:])

    def _clocked(self, work: Callable[[], object]) -> float:
        """Median seconds from asking until the device has finished."""
        times = []
        for _ in range(ROUNDS):
            self._queue.finish()
            start = time.perf_counter()
            work()
            self._queue.finish()
            times.append(time.perf_counter() - start)
        return median(times[1:])
