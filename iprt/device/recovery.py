"""Recovery from device failures: error translation, waiting with a limit, and a second try.

A hung kernel cannot be stopped, so only the wait for it ends. A lost context is retried once with
a new one. That helps after a driver reset, or if other programs held the device, but not against
a defect of a kernel.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TypeVar

import pyopencl as cl

from iprt.device.budget import what_to_lower
from iprt.errors import DeviceError, DeviceHangError, DeviceLostError, KernelError

LOG = logging.getLogger("iprt.device")
Result = TypeVar("Result")

_STATUS = cl.status_code
NVIDIA_FAULT = -9999
"""NVIDIA's error code for an invalid memory access in a kernel, which loses the context."""
LOST = frozenset(
    (
        _STATUS.OUT_OF_RESOURCES,
        _STATUS.INVALID_COMMAND_QUEUE,
        _STATUS.INVALID_CONTEXT,
        _STATUS.DEVICE_NOT_AVAILABLE,
        _STATUS.EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST,
        NVIDIA_FAULT,
    )
)
EXHAUSTED = frozenset((_STATUS.MEM_OBJECT_ALLOCATION_FAILURE, _STATUS.OUT_OF_HOST_MEMORY))
NOT_BUILT = frozenset((_STATUS.BUILD_PROGRAM_FAILURE, _STATUS.LINK_PROGRAM_FAILURE))

SHORTEST_PAUSE_S, LONGEST_PAUSE_S = 5e-5, 1e-2


@contextmanager
def reported(device: str, what: str, buffers: Mapping[str, int]) -> Iterator[None]:
    """Translate OpenCL errors of a `with` block to errors of the package.

    Errors that indicate a defect of the package pass through.

    Parameters
    ----------
    device, what : str
        Name of the device, and name of the operation for messages.
    buffers : mapping of str to int
        Bytes of the device's buffers by name.

    Raises
    ------
    DeviceLostError
        The context is lost.
    DeviceError
        The memory does not suffice.
    KernelError
        The driver compiles the kernel at its launch, and fails.
    """
    try:
        yield
    except cl.Error as error:
        if error.code in LOST:
            raise DeviceLostError(f"{device} gave up at {what} ({_status(error)})") from error
        if error.code in EXHAUSTED:
            raise DeviceError(
                f"{device} ran out of memory at {what}: {what_to_lower(buffers)}"
            ) from error
        if error.code in NOT_BUILT:
            raise KernelError(f"{what} did not build on {device}: {error}") from error
        raise


def _status(error: cl.Error) -> str:
    try:
        return str(_STATUS.to_string(error.code))
    except ValueError:  # a vendor-specific code
        return str(error.code)


def end_of(queue: cl.CommandQueue) -> cl.Event:
    """Return an event that completes when all enqueued work is done, and start that work."""
    done = cl.enqueue_marker(queue)
    queue.flush()
    return done


def wait(device: str, done: cl.Event, limit_s: float) -> None:
    """Wait for an event of a queue that was flushed.

    Time in which this process is stopped or gets no CPU does not count.

    Raises
    ------
    DeviceHangError
        The work takes longer than `limit_s` seconds.
    """
    waited = 0.0
    while done.command_execution_status > cl.command_execution_status.COMPLETE:
        if waited >= limit_s:
            raise DeviceHangError(
                f"{device} has not answered for {limit_s:g} s: it hangs, or frames take long and "
                "need a higher --frame-limit"
            )
        pause = min(max(0.02 * waited, SHORTEST_PAUSE_S), LONGEST_PAUSE_S)
        time.sleep(pause)
        waited += pause
    done.wait()  # raises the error that ended the work


def with_second_try(
    attempt: Callable[[], Result], progress: Callable[[], int] = lambda: 0
) -> Result:
    """Return the result of `attempt`, which is repeated if its context is lost.

    Parameters
    ----------
    attempt : callable
        Makes its own context.
    progress : callable
        Returns the amount of finished work. An attempt that got further may be repeated again.

    Raises
    ------
    DeviceLostError
        The context was lost twice without progress.
    """
    done = -1
    while True:
        try:
            return attempt()
        except DeviceLostError as error:
            if progress() <= done:
                raise DeviceLostError(
                    f"{error}, for the second time: choose another --device, or lower --size"
                ) from error
            LOG.warning("%s: starting again in a new context", error)
        # Outside of the handler, no traceback holds the attempt's buffers.
        done = progress()
