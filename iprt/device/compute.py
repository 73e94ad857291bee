"""An OpenCL device with its queue: kernels by file name, buffers by name, times by pass."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.array as cla
from numpy.typing import DTypeLike, NDArray

from iprt.device.profile import Profile
from iprt.errors import DeviceError, KernelError
from iprt.resources import CL

Define = int | float | bool | str


class Kernel:
    """A built kernel. Call it with its global size and arguments; events go to the profile."""

    def __init__(self, device: ComputeDevice, kernel: Any) -> None:
        self._device = device
        self._kernel = kernel

    def __call__(self, size: tuple[int, ...], *args: Any) -> None:
        """Enqueue over `size` work items, x first; the kernel guards the grid's edge.

        Python ints and floats become 32-bit scalars, arrays their buffers, None a null pointer.
        """
        local = self._device.group_size(len(size))
        rounded = tuple(-(-n // m) * m for n, m in zip(size, local, strict=True))
        event = self._kernel(self._device.queue, rounded, local, *map(_argument, args))
        self._device.profile.record(event)


class ComputeDevice:
    """Context, profiling queue and named buffers on one OpenCL device.

    Buffers are `pyopencl.array.Array`: shape and dtype known, `.get()` reads back.
    """

    def __init__(self, device: cl.Device) -> None:
        self.device = device
        self.context = cl.Context([device])
        self.queue = cl.CommandQueue(
            self.context, properties=cl.command_queue_properties.PROFILING_ENABLE
        )
        self.profile = Profile()
        self.buffers: dict[str, int] = {}
        self._programs: dict[tuple[str, str], Any] = {}

    @property
    def name(self) -> str:
        return f"{self.device.name.strip()} ({self.device.platform.name.strip()})"

    @property
    def is_cpu(self) -> bool:
        return bool(self.device.type & cl.device_type.CPU)

    def group_size(self, dimensions: int) -> tuple[int, ...]:
        """One fixed work-group size per dimensionality, so that PoCL compiles each kernel once."""
        if dimensions == 1:
            return (64,) if self.is_cpu else (128,)
        return (64, 1) if self.is_cpu else (16, 8)

    def kernel(self, file: str, name: str, defines: Mapping[str, Define] | None = None) -> Kernel:
        """Build `cl/<file>` with `-D` from `defines` (False omits) and return kernel `name`.

        Raises
        ------
        KernelError
            The program did not build; the message holds the device and the build log.
        """
        options = ["-cl-std=CL1.2", "-I", str(CL / "lib")]
        for define, value in sorted((defines or {}).items()):
            if value is not False:
                options.append(f"-D{define}={_literal(value)}")
        key = (file, " ".join(options))
        if key not in self._programs:
            self._programs[key] = self._build(file, options)
        return Kernel(self, cl.Kernel(self._programs[key], name))

    def _build(self, file: str, options: list[str]) -> Any:
        source = (CL / file).read_text()
        try:
            with self.profile.compiling(), warnings.catch_warnings():
                # Some compilers report success at length; a failure raises with its log.
                warnings.simplefilter("ignore", cl.CompilerWarning)
                return cl.Program(self.context, source).build(options)
        except cl.RuntimeError as error:
            raise KernelError(f"cl/{file} did not build on {self.name}: {error}") from error

    @property
    def built_programs(self) -> list[tuple[str, str]]:
        """(file, options) of every program built so far."""
        return list(self._programs)

    def empty(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        """An uninitialised buffer, accounted under `name` (the same name again replaces it)."""
        try:
            array = cla.empty(self.queue, shape, dtype)
        except (cl.MemoryError, cl.LogicError) as error:
            need = int(np.prod(shape)) * np.dtype(dtype).itemsize / 2**20
            raise DeviceError(
                f"{self.name} cannot hold the buffer '{name}' ({need:.0f} MiB): "
                "lower --size or use a smaller panorama"
            ) from error
        self.buffers[name] = array.nbytes
        return array

    def zeros(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        array = self.empty(name, shape, dtype)
        self.fill_zero(array)
        return array

    def fill_zero(self, array: cla.Array) -> None:
        self.profile.record(
            cl.enqueue_fill_buffer(self.queue, array.data, np.uint8(0), 0, array.nbytes)
        )

    def upload(self, name: str, values: NDArray[Any]) -> cla.Array:
        """A new buffer holding a copy of `values`."""
        array = self.empty(name, values.shape, values.dtype)
        self.write(array, values)
        return array

    def write(self, array: cla.Array, values: NDArray[Any]) -> None:
        """Overwrite a buffer with host values of its shape and dtype."""
        host = np.ascontiguousarray(values, dtype=array.dtype).reshape(array.shape)
        self.profile.record(cl.enqueue_copy(self.queue, array.data, host, is_blocking=True))

    def read(self, array: cla.Array) -> NDArray[Any]:
        """A host copy of a buffer, after all enqueued work on it."""
        host = np.empty(array.shape, array.dtype)
        self.profile.record(cl.enqueue_copy(self.queue, host, array.data, is_blocking=True))
        return host

    def finish(self) -> None:
        self.queue.finish()
        self.profile.resolve()


def _argument(value: Any) -> Any:
    if isinstance(value, cla.Array):
        return value.data
    if isinstance(value, bool | int):
        return np.int32(value)
    if isinstance(value, float):
        return np.float32(value)
    return value


def _literal(value: Define) -> str:
    if isinstance(value, bool):
        return "1"
    if isinstance(value, float):
        return f"{np.float32(value)!s}f" if "." in str(np.float32(value)) else f"{value!r}f"
    return str(value)
