"""An OpenCL device with its queue, named buffers and transfers."""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cached_property
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.array as cla
from numpy.typing import DTypeLike, NDArray

from iprt.device.budget import amount, what_to_lower
from iprt.device.host_memory import LARGE, HostMemory
from iprt.device.profile import Kind, Profile
from iprt.device.program import device_key
from iprt.device.recovery import end_of, reported, wait
from iprt.errors import DeviceError, DeviceHangError

_HUNG: list[Any] = []
"""Host memory that hung devices may still read. Kept until the process ends."""


def _size(shape: tuple[int, ...], dtype: DTypeLike) -> int:
    """Return the bytes of a buffer."""
    return int(np.prod(shape)) * np.dtype(dtype).itemsize


class BufferDevice:
    """Context, profiling queue and named buffers on one OpenCL device.

    Buffers are `pyopencl.array.Array`, with shape, dtype and `.get()`.

    Parameters
    ----------
    device : pyopencl.Device
    limit_s : float or None
        Seconds of waiting after which the device counts as hung; None waits for ever.

    Attributes
    ----------
    opengl : dict of str to int
        Bytes by name of OpenGL's memory, which may be on another device.

    Raises
    ------
    DeviceLostError, DeviceHangError
        Raised by all methods: the driver gave up, or did not answer in time.
    """

    def __init__(self, device: cl.Device, limit_s: float | None = None) -> None:
        self.device = device
        self.limit_s = limit_s
        self.buffers: dict[str, int] = {}
        self.opengl: dict[str, int] = {}
        with self.reported("creating a context"):
            self.context = cl.Context([device])
            self.queue = cl.CommandQueue(
                self.context, properties=cl.command_queue_properties.PROFILING_ENABLE
            )
        self.profile = Profile()
        self._in_flight: deque[Any] = deque()  # events that keep host memory alive
        self._memory = HostMemory()
        # Host memory that kernels use. It must outlive its buffer until the queue is finished.
        self._shared: list[tuple[Callable[[], Any], NDArray[Any]]] = []

    @cached_property
    def name(self) -> str:
        """Name of the device and its platform."""
        return f"{self.device.name.strip()} ({self.device.platform.name.strip()})"

    @cached_property
    def key(self) -> str:
        """Text that results which depend on the device, and its driver, are kept under."""
        return device_key(self.device)

    @property
    def is_cpu(self) -> bool:
        """True for a CPU."""
        return bool(self.device.type & cl.device_type.CPU)

    @property
    def wide(self) -> bool:
        """True if work items process several texels as vectors (`cl/lib/maths/lanes.h`).

        Loops over neighbouring pixels are then unrolled too (`cl/lib/gbuffer/planes.h`).
        """
        return self.is_cpu

    @property
    def half_planes(self) -> bool:
        """True if planes that last for one frame are in half precision (`cl/lib/gbuffer/stored.h`).

        A CPU takes longer to convert numbers than to move them.
        """
        return not self.is_cpu

    @property
    def memory(self) -> int:
        """Bytes of global memory, as reported by the driver."""
        return int(self.device.global_mem_size)

    @property
    def largest_buffer(self) -> int:
        """Largest size of a buffer in bytes."""
        return int(self.device.max_mem_alloc_size)

    def reported(self, what: str) -> AbstractContextManager[None]:
        """Translate OpenCL errors of a `with` block; see `iprt.device.recovery.reported`."""
        return reported(self.name, what, self.buffers)

    def empty(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        """Allocate an uninitialised buffer, accounted under `name`.

        The same name again replaces the account.

        Raises
        ------
        DeviceError
            The memory does not suffice.
        """
        with self._holding(name, shape, dtype):
            if self.is_cpu and _size(shape, dtype) >= LARGE:
                array = self._in_pages(shape, dtype, zeros=False)
            else:
                array = cla.empty(self.queue, shape, dtype)
        self.buffers[name] = array.nbytes
        return array

    def zeros(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        """Allocate a buffer of zeros, accounted under `name`.

        On a CPU, pages of it take memory only when they are written.
        """
        if not self.is_cpu:
            array = self.empty(name, shape, dtype)
            self.fill_zero(array)
            return array
        with self._holding(name, shape, dtype):
            array = self._in_pages(shape, dtype, zeros=True)
        self.buffers[name] = array.nbytes
        return array

    def discard(self, *arrays: cla.Array) -> None:
        """Wait, and give back the memory of buffers from `zeros`, on a CPU: their values end."""
        self.wait()
        lost = {id(array) for array in arrays}
        for known, host in self._shared:
            if id(known()) in lost:
                self._memory.discard(host)

    @property
    def hosted(self) -> int:
        """Bytes of the buffers in the host's memory: on a CPU, of all large ones."""
        return sum(host.nbytes for array, host in self._shared if array() is not None)

    @contextmanager
    def _holding(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> Iterator[None]:
        """Translate errors of a `with` block that allocates a buffer."""
        try:
            yield
        except (cl.MemoryError, cl.LogicError, OSError) as error:
            need = _size(shape, dtype)
            raise DeviceError(
                f"{self.name} cannot hold the buffer '{name}' ({amount(need)}): "
                f"{what_to_lower(self.buffers | {name: need})}"
            ) from error

    def fill_zero(self, array: cla.Array) -> None:
        """Fill a buffer with zeros, without waiting."""
        with self.reported("clearing a buffer"):
            event = cl.enqueue_fill_buffer(self.queue, array.data, np.uint8(0), 0, array.nbytes)
        self.profile.record(event, "fill", Kind.TRANSFER, array.nbytes)

    def upload(self, name: str, values: NDArray[Any]) -> cla.Array:
        """Allocate a buffer with a copy of `values`, accounted under `name`."""
        array = self.empty(name, values.shape, values.dtype)
        self.write(array, values)
        return array

    def share(self, name: str, values: NDArray[Any]) -> cla.Array:
        """Return `values` as a read-only buffer, on a CPU without a copy.

        `values` must not change while the buffer lives. A copy is accounted under `name`.
        """
        if not self.is_cpu:
            return self.upload(name, values)
        with self.reported("sharing memory"):
            return self._hosted(np.ascontiguousarray(values), cl.mem_flags.READ_ONLY)

    def _in_pages(self, shape: tuple[int, ...], dtype: DTypeLike, *, zeros: bool) -> cla.Array:
        """Return a buffer in the host's memory, which released buffers may have left."""
        if any(array() is None for array, _ in self._shared):
            self.wait()  # work may still use them
        host = self._memory.array(shape, dtype, zeros=zeros)
        return self._hosted(host, cl.mem_flags.READ_WRITE)

    def _hosted(self, host: NDArray[Any], flags: int) -> cla.Array:
        """Return the host's memory as a buffer."""
        buffer = cl.Buffer(self.context, flags | cl.mem_flags.USE_HOST_PTR, hostbuf=host)
        array = cla.Array(self.queue, host.shape, host.dtype, data=buffer)
        self._shared.append((weakref.ref(array), host))
        return array

    def write(self, array: cla.Array, values: NDArray[Any]) -> None:
        """Overwrite a buffer, or rows of one, with host values of its shape, without waiting.

        `values` must not change until the transfer is done, that is until `wait` or `read`.
        """
        host = np.ascontiguousarray(values, dtype=array.dtype).reshape(array.shape)
        with self.reported("a transfer"):
            event = cl.enqueue_copy(
                self.queue, array.base_data, host, dst_offset=array.offset, is_blocking=False
            )
        done = cl.command_execution_status.COMPLETE
        while self._in_flight and self._in_flight[0].command_execution_status == done:
            self._in_flight.popleft()
        self._in_flight.append(event)
        self._record_transfer(event, "write", host.nbytes)

    def read(self, array: cla.Array) -> NDArray[Any]:
        """Return a host copy of a buffer, after all enqueued work."""
        host = np.empty(array.shape, array.dtype)
        self.finish()  # a blocking transfer would wait for earlier kernels without a limit
        with self.reported("a transfer"):
            event = cl.enqueue_copy(self.queue, host, array.data, is_blocking=True)
        self._record_transfer(event, "read", host.nbytes)
        return host

    def fetch(self, array: cla.Array) -> Callable[[], NDArray[Any]]:
        """Start to copy a buffer to the host, and return a function that returns the copy.

        That function waits for the copy and the work before it, not for work enqueued later.
        """
        host = np.empty(array.shape, array.dtype)
        with self.reported("a transfer"):
            event = cl.enqueue_copy(self.queue, host, array.data, is_blocking=False)
            self.queue.flush()
        self._in_flight.append(event)
        self._record_transfer(event, "read", host.nbytes)

        def fetched() -> NDArray[Any]:
            if event.command_execution_status != cl.command_execution_status.COMPLETE:
                self._wait(event)
            return host

        return fetched

    def wait(self) -> None:
        """Wait until all enqueued work is done."""
        self._wait(None)
        self._in_flight.clear()
        for array, host in self._shared:
            if array() is None:
                self._memory.release(host)
        self._shared[:] = [(array, host) for array, host in self._shared if array() is not None]

    def _wait(self, done: cl.Event | None) -> None:
        """Wait for an event of the flushed queue; None: for all enqueued work."""
        self.profile.synchronised()
        try:
            with self.reported("its work"):
                if self.limit_s is not None:
                    wait(self.name, done or end_of(self.queue), self.limit_s)
                elif done is None:
                    self.queue.finish()
                else:
                    done.wait()
        except DeviceHangError:
            # The destructor of a transfer's event would wait for the transfer.
            _HUNG.extend((*self._in_flight, *self._shared))
            raise

    def _record_transfer(self, event: cl.Event, name: str, size: int) -> None:
        """Record a transfer from or to the host's memory."""
        if self.profile.recording:
            # The profile reads events late. A bare event does not keep the host's memory alive.
            timed = cl.Event.from_int_ptr(event.int_ptr)
            self.profile.record(timed, name, Kind.TRANSFER, size)

    def finish(self) -> None:
        """Wait until all enqueued work is done, and let the profile read event times."""
        self.wait()
        self.profile.finished()
