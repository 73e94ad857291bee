"""An OpenCL device with its queue: kernels by file name, buffers by name, times by pass."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.array as cla
from numpy.typing import DTypeLike, NDArray

from iprt.device.bands import Bands
from iprt.device.budget import amount, what_to_lower
from iprt.device.profile import Kind, Profile
from iprt.device.program import Define, Program, build, variant
from iprt.device.recovery import reported, wait
from iprt.device.signature import Parameter
from iprt.errors import DeviceError, DeviceHangError

MOST_IN_FLIGHT = 64
"""Transfers after which it is asked which of them are done."""

_Range = tuple[tuple[int, ...], tuple[int, ...]]
_UNBOUND = object()
_HUNG: list[Any] = []
"""What devices that hang may still read, until the program ends."""


class Kernel:
    """A built kernel of one call site. Its arguments stay bound from call to call.

    Parameters
    ----------
    device : ComputeDevice
    kernel : pyopencl.Kernel
        Nobody else sets its arguments.
    program : str
        The name of its program in the profile.
    parameters : sequence of Parameter
        `iprt.device.signature.signature` of the kernel.
    """

    def __init__(
        self, device: ComputeDevice, kernel: Any, program: str, parameters: Sequence[Parameter]
    ) -> None:
        self._device = device
        self._kernel = kernel
        self._program = program
        self._name: str = kernel.function_name
        self._signature = parameters
        self._parameters = [parameter.name for parameter in parameters]
        self._known = frozenset(self._parameters)
        self._described = f"kernel '{self._name}' of cl/{program}"
        kernel.set_scalar_arg_dtypes([parameter.scalar for parameter in parameters])
        self._bound: list[Any] = [_UNBOUND] * len(parameters)
        self._raw: list[Any] = [None] * len(parameters)  # the same as pyopencl takes them
        self._bytes: dict[int, int] = {}  # of the buffers, by index
        self._size: tuple[int, ...] = ()
        self._range: _Range = ((), ())
        self._launched = False

    def __call__(self, size: tuple[int, ...], *groups: Mapping[str, Any], **own: Any) -> None:
        """Enqueue over `size` work items, x first; the kernel guards the grid's edge.

        Parameters
        ----------
        size : tuple of int
        groups : mappings of str to object
            What several kernels take, by the names of their parameters; this one takes what it
            needs of it. Ints and floats, arrays for buffers, None for a null pointer.
        own : the kernel's own parameters

        Raises
        ------
        TypeError
            A parameter is given nothing, or `own` holds what is none.
        """
        self._bind(groups, own)
        device = self._device
        if size != self._size:
            local = device.group_size(len(size))
            rounded = tuple(-(-n // m) * m for n, m in zip(size, local, strict=True))
            self._size, self._range = size, (rounded, local)
        global_size, local = self._range
        first = not self._launched and device.is_first_launch(self._program, self._name)
        self._launched = True
        if first:
            events = [self._launch_first(global_size, local)]
        elif device.bands is not None:
            events = device.bands.launch(
                (self._program, self._name),
                global_size,
                local,
                lambda offset, part: self._enqueue(part, local, offset),
            )
        else:
            events = [self._enqueue(global_size, local)]
        profile = device.profile
        if profile.recording:
            size_bytes = self._bound_bytes()
            for event in events:
                profile.record(event, self._name, Kind.KERNEL, size_bytes)

    def _bind(self, groups: tuple[Mapping[str, Any], ...], own: dict[str, Any]) -> None:
        given: dict[str, Any] = {}
        for group in groups:
            given.update(group)
        given.update(own)
        try:
            values = [given[name] for name in self._parameters]
        except KeyError as error:
            raise TypeError(f"{self._described} is not given {error}") from None
        if not own.keys() <= self._known:
            unknown = ", ".join(own.keys() - self._known)
            raise TypeError(f"{self._described} has no parameter '{unknown}'")
        changed = False
        bound = self._bound
        for index, value in enumerate(values):
            if value is not bound[index]:
                self._take(index, value)
                changed = True
        if changed:
            self._kernel.set_args(*self._raw)

    def _take(self, index: int, value: Any) -> None:
        self._bound[index] = value
        if isinstance(value, cla.Array):
            self._raw[index] = value.data
            self._bytes[index] = value.nbytes
        else:
            self._raw[index] = value
            self._bytes.pop(index, None)

    def _bound_bytes(self) -> int:
        """Bytes of the buffers that are bound, each counted once."""
        return sum({id(self._bound[i]): size for i, size in self._bytes.items()}.values())

    def _enqueue(
        self, size: tuple[int, ...], local: tuple[int, ...], offset: tuple[int, ...] = ()
    ) -> Any:
        # PoCL compiles kernels with an offset anew, also one of zeros.
        start = offset if any(offset) else None
        try:
            return cl.enqueue_nd_range_kernel(self._device.queue, self._kernel, size, local, start)
        except cl.Error as error:
            with self._device.reported(self._name):
                raise error

    def _launch_first(self, size: tuple[int, ...], local: tuple[int, ...]) -> Any:
        """With nothing else on the queue, so that what it takes to compile is seen."""
        device = self._device
        device.building(self._program.partition(" ")[0])
        device.wait()
        start = time.perf_counter()
        event = self._enqueue(size, local)
        device.wait()
        elapsed = (time.perf_counter() - start) * 1e3
        device.profile.launched_first(self._program, event, elapsed)
        return event


class ComputeDevice:
    """Context, profiling queue and named buffers on one OpenCL device.

    Buffers are `pyopencl.array.Array`: shape and dtype known, `.get()` reads back.

    Parameters
    ----------
    device : pyopencl.Device
    limit_s : float or None
        Seconds after which a device that has not finished its work is taken to hang; None waits
        for ever.

    Attributes
    ----------
    opengl : dict of str to int
        Bytes by name that OpenGL holds besides `buffers`, perhaps on another device.
    building : callable
        Called with the name of a file of `cl/` before it is built, and before one of its kernels is
        launched first: both may take seconds.
    bands : Bands or None
        Launches kernels in parts, between which work can be abandoned. None: as a whole.
    most_programs : int or None
        So many built programs are kept, and those that are in use. None: all are.

    Raises
    ------
    DeviceLostError, DeviceHangError
        Here and in all methods: the driver gave up, or did not answer in time.
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
        self.building: Callable[[str], None] = lambda file: None
        self.bands: Bands | None = None
        self.most_programs: int | None = None
        self._programs: dict[tuple[str, str], Program] = {}  # the last one used comes last
        self._launched: set[tuple[str, str]] = set()
        self._in_flight: list[Any] = []  # events that keep host memory alive, until it is read

    @cached_property
    def name(self) -> str:
        return f"{self.device.name.strip()} ({self.device.platform.name.strip()})"

    @property
    def is_cpu(self) -> bool:
        return bool(self.device.type & cl.device_type.CPU)

    @property
    def memory(self) -> int:
        """Bytes that the device has, as its driver says."""
        return int(self.device.global_mem_size)

    @property
    def largest_buffer(self) -> int:
        """Bytes that one buffer may have."""
        return int(self.device.max_mem_alloc_size)

    def reported(self, what: str) -> AbstractContextManager[None]:
        """OpenCL errors of the block as errors of the package; see `iprt.device.recovery`."""
        return reported(self.name, what, self.buffers)

    def group_size(self, dimensions: int) -> tuple[int, ...]:
        """One fixed work-group size per dimensionality, so that PoCL compiles each kernel once."""
        if dimensions == 1:
            return (64,) if self.is_cpu else (128,)
        return ((64, 1) if self.is_cpu else (16, 8)) + (1,) * (dimensions - 2)

    def kernel(self, file: str, name: str, defines: Mapping[str, Define] | None = None) -> Kernel:
        """Build `cl/<file>` with `-D` from `defines` (False omits) and return kernel `name`.

        Raises
        ------
        KernelError
            The program did not build.
        """
        program, options = variant(file, defines)
        key = (file, " ".join(options))
        found = self._programs.pop(key, None)
        if found is None:
            self.building(file)
            with self.profile.compiling(program):
                built = build(self.context, file, options)
            found = Program(program, built, file, tuple(options))
        self._programs[key] = found
        kernel = Kernel(self, cl.Kernel(found.built, name), program, found.signature(name))
        found.kernels.add(kernel)
        self._forget_programs()
        return kernel

    def to_compile(self, kernels: Iterable[tuple[str, str, Mapping[str, Define]]]) -> int:
        """How often the driver has to compile for these (file, kernel, defines).

        Programs that are not built yet, and kernels that were not launched yet, count one each.
        """
        missing = set()
        for file, name, defines in kernels:
            program, options = variant(file, defines)
            if (file, " ".join(options)) not in self._programs:
                missing.add((program, ""))
            if (program, name) not in self._launched:
                missing.add((program, name))
        return len(missing)

    def _forget_programs(self) -> None:
        """Release programs that are not in use, the oldest first, while there are too many."""
        for key, program in list(self._programs.items()):
            if self.most_programs is None or len(self._programs) <= self.most_programs:
                return
            if not program.kernels:
                del self._programs[key]
                self._launched -= {known for known in self._launched if known[0] == program.name}

    def is_first_launch(self, program: str, kernel: str) -> bool:
        """Whether it is asked for the first time about this kernel."""
        first = (program, kernel) not in self._launched
        self._launched.add((program, kernel))
        return first

    @property
    def built_programs(self) -> list[tuple[str, str]]:
        """(file, options) of every program built so far."""
        return list(self._programs)

    def empty(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        """An uninitialised buffer, accounted under `name` (the same name again replaces it)."""
        try:
            array = cla.empty(self.queue, shape, dtype)
        except (cl.MemoryError, cl.LogicError) as error:
            need = int(np.prod(shape)) * np.dtype(dtype).itemsize
            raise DeviceError(
                f"{self.name} cannot hold the buffer '{name}' ({amount(need)}): "
                f"{what_to_lower(self.buffers | {name: need})}"
            ) from error
        self.buffers[name] = array.nbytes
        return array

    def zeros(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        array = self.empty(name, shape, dtype)
        self.fill_zero(array)
        return array

    def fill_zero(self, array: cla.Array) -> None:
        with self.reported("clearing a buffer"):
            event = cl.enqueue_fill_buffer(self.queue, array.data, np.uint8(0), 0, array.nbytes)
        self.profile.record(event, "fill", Kind.TRANSFER, array.nbytes)

    def upload(self, name: str, values: NDArray[Any]) -> cla.Array:
        """A new buffer holding a copy of `values`."""
        array = self.empty(name, values.shape, values.dtype)
        self.write(array, values)
        return array

    def write(self, array: cla.Array, values: NDArray[Any]) -> None:
        """Overwrite a buffer with host values of its shape and dtype, without waiting.

        `values` must stay as they are until the device has come so far: after `wait` or `read`.
        """
        host = np.ascontiguousarray(values, dtype=array.dtype).reshape(array.shape)
        with self.reported("a transfer"):
            event = cl.enqueue_copy(self.queue, array.data, host, is_blocking=False)
        if len(self._in_flight) >= MOST_IN_FLIGHT:
            done = cl.command_execution_status.COMPLETE
            running = [e for e in self._in_flight if e.command_execution_status != done]
            self._in_flight[:] = running
        self._in_flight.append(event)
        self.profile.record(event, "write", Kind.TRANSFER, host.nbytes)

    def read(self, array: cla.Array) -> NDArray[Any]:
        """A host copy of a buffer, after all enqueued work on it."""
        host = np.empty(array.shape, array.dtype)
        self.wait()  # a blocking transfer would wait for the kernels before it without a limit
        with self.reported("a transfer"):
            event = cl.enqueue_copy(self.queue, host, array.data, is_blocking=True)
        self.profile.record(event, "read", Kind.TRANSFER, host.nbytes)
        return host

    def wait(self) -> None:
        """Until all enqueued work is done."""
        self.profile.synchronised()
        try:
            with self.reported("its work"):
                if self.limit_s is None:
                    self.queue.finish()
                else:
                    wait(self.name, self.queue, self.limit_s)
        except DeviceHangError:
            # Events of transfers wait for their end when they are forgotten.
            _HUNG.extend(self._in_flight)
            raise
        self._in_flight.clear()

    def finish(self) -> None:
        """`wait`; times may be read."""
        self.wait()
        self.profile.finished()
