"""Bandwidth of memory and of the bus, and the cost of a launch."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import numpy as np
import pyopencl as cl
import pytest

from iprt.device.compute import ComputeDevice

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

Tell = Callable[..., None]


@pytest.fixture(scope="module")
def program(device: ComputeDevice) -> cl.Program:
    return cl.Program(device.context, SOURCE).build()


def on_device(launch: Callable[[], cl.Event]) -> float:
    """Median seconds from start to end, by the device's clock."""
    times = []
    for _ in range(ROUNDS):
        event = launch()
        event.wait()
        times.append(1e-9 * (event.profile.end - event.profile.start))
    return median(times[1:])


def clocked(queue: cl.CommandQueue, work: Callable[[], object]) -> float:
    """Median seconds from the request until the device has finished."""
    times = []
    for _ in range(ROUNDS):
        queue.finish()
        start = time.perf_counter()
        work()
        queue.finish()
        times.append(time.perf_counter() - start)
    return median(times[1:])


@pytest.mark.parametrize(("name", "width"), [("copy1", 4), ("copy4", 16)])
def test_copies(
    device: ComputeDevice, program: cl.Program, tell: Tell, name: str, width: int
) -> None:
    """Bytes read and written, for floats and for four at a time."""
    size = LARGEST_OF_CPU if device.is_cpu else LARGEST
    size = min(size, device.memory // 8, device.largest_buffer) // 4096 * 4096
    one, other = (cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size) for _ in range(2))
    cl.enqueue_fill_buffer(device.queue, one, np.uint8(1), 0, size)
    kernel, group = cl.Kernel(program, name), (64,) if device.is_cpu else (256,)
    seconds = on_device(lambda: kernel(device.queue, (size // width,), group, one, other))
    tell(**{"GB/s": 2e-9 * size / seconds, "buffer MiB": size >> 20})


def test_transfers(device: ComputeDevice, tell: Tell) -> None:
    """Pageable memory, by the clock, as pictures come and go."""
    host = np.ones(MOVED, np.uint8)
    buffer = cl.Buffer(device.context, cl.mem_flags.READ_WRITE, MOVED)
    for name, pair in (("to the device", (buffer, host)), ("from the device", (host, buffer))):
        seconds = clocked(device.queue, lambda pair=pair: cl.enqueue_copy(device.queue, *pair))  # type: ignore[misc]
        tell(direction=name, **{"GB/s": 1e-9 * MOVED / seconds})


def test_launches(device: ComputeDevice, program: cl.Program, tell: Tell) -> None:
    """An empty kernel: waited for each time, and many in a queue."""
    kernel = cl.Kernel(program, "nothing")
    buffer = cl.Buffer(device.context, cl.mem_flags.READ_WRITE, 4096)  # the kernel holds no count
    kernel.set_args(buffer)
    enqueued: list[float] = []
    between: list[float] = []

    def launch() -> cl.Event:
        return cl.enqueue_nd_range_kernel(device.queue, kernel, (128,), (64,))

    def many() -> None:
        start = time.perf_counter()
        events = [launch() for _ in range(QUEUED)]
        enqueued.append(time.perf_counter() - start)
        device.queue.finish()
        between.append(1e-9 * (events[-1].profile.end - events[0].profile.start))

    seconds = {
        "one, waited for": clocked(device.queue, launch),
        "one of many, by the clock": clocked(device.queue, many) / QUEUED,
        "one of many, to enqueue": median(enqueued) / QUEUED,
        "one of many, on the device": median(between) / QUEUED,
        "one, start to end": on_device(launch),
    }
    tell(**{f"{name}, us": 1e6 * value for name, value in seconds.items()})
