"""When a device fails: OpenCL's errors as our own, waiting with a limit, and a second try.

A hung kernel cannot be stopped from outside, so the wait for it ends instead. What the driver
reports as lost is worth one more try in a new context: that helps against a reset of the driver
and against other programs that held the device, and not against a fault of ours.
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
"""NVIDIA's own code for a kernel that read or wrote where it must not; the context is gone."""
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
    """OpenCL errors of the block as errors of the package; those that tell of a defect stay.

    Parameters
    ----------
    device, what : str
        Names of the device and of what the block does.
    buffers : mapping of str to int
        Bytes by name of what the device holds.

    Raises
    ------
    DeviceLostError
        The context is of no use any more.
    DeviceError
        Memory did not suffice.
    KernelError
        The driver compiled the kernel only now, and could not.
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
    except ValueError:  # a code of the vendor's own
        return str(error.code)


def wait(device: str, queue: cl.CommandQueue, limit_s: float) -> None:
    """Until all that is enqueued is done.

    Time in which this process was itself stopped or starved does not count.

    Raises
    ------
    DeviceHangError
        It took longer than `limit_s` seconds.
    """
    done = cl.enqueue_marker(queue)
    queue.flush()
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
    done.wait()  # raises what the work ended with


def with_second_try(
    attempt: Callable[[], Result], progress: Callable[[], int] = lambda: 0
) -> Result:
    """The result of `attempt`, which makes its own context; again from the start if that is lost.

    Parameters
    ----------
    attempt : callable
    progress : callable
        How much is done for good: a context that got further may be lost again.

    Raises
    ------
    DeviceLostError
        The second context was lost too.
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
        # Out here nothing holds the attempt's buffers any more.
        done = progress()
