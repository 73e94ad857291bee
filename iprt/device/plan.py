"""A stand-in device that records the kernels and buffers of a renderer without making them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.profile import Profile
from iprt.device.program import Define, PlannedKernel


@dataclass(frozen=True)
class PlannedBuffer:
    """Shape and dtype of a buffer that a device would allocate."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __getitem__(self, rows: slice) -> Self:
        """Return a part of the buffer."""
        count = len(range(*rows.indices(self.shape[0])))
        return replace(self, shape=(count, *self.shape[1:]))

    @property
    def ndim(self) -> int:
        """Number of dimensions."""
        return len(self.shape)

    @property
    def nbytes(self) -> int:
        """Size in bytes."""
        return int(np.prod(self.shape)) * self.dtype.itemsize


class UnbuiltKernel:
    """A kernel whose launches do nothing."""

    def fixed(self, *_: Mapping[str, Any], **__: Any) -> Self:
        """Ignore the arguments and return the kernel."""
        return self

    def __call__(self, *_: Any, **__: Any) -> None:
        """Do nothing."""


class PlanDevice(ComputeDevice):
    """Stand-in for a `ComputeDevice` while a renderer is constructed, on any machine.

    Parameters
    ----------
    is_cpu : bool
        Stand in for a CPU, else for a GPU.

    Attributes
    ----------
    buffers : dict of str to int
        Bytes by buffer name.
    kernels : list of PlannedKernel
        Kernels in the order of construction, without defines that are False.
    """

    def __init__(self, *, is_cpu: bool = True) -> None:
        self._is_cpu = is_cpu
        self.profile = Profile()
        self.buffers: dict[str, int] = {}
        self.opengl: dict[str, int] = {}
        self.kernels: list[PlannedKernel] = []

    @property
    def is_cpu(self) -> bool:
        """True if the device stands in for a CPU."""
        return self._is_cpu

    def kernel(  # type: ignore[override]
        self,
        file: str,
        name: str,
        defines: Mapping[str, Define] | None = None,
        *,
        items: int = 0,
        later: bool = False,
    ) -> UnbuiltKernel:
        """Record a kernel."""
        used = {key: value for key, value in (defines or {}).items() if value is not False}
        self.kernels.append(PlannedKernel(file, name, used, items, later))
        return UnbuiltKernel()

    def empty(
        self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32
    ) -> PlannedBuffer:
        """Record a buffer."""
        buffer = PlannedBuffer(shape, np.dtype(dtype))
        self.buffers[name] = buffer.nbytes
        return buffer

    def zeros(
        self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32
    ) -> PlannedBuffer:
        """Record a buffer."""
        return self.empty(name, shape, dtype)

    def discard(self, *arrays: Any) -> None:
        """Do nothing."""

    def share(self, name: str, values: NDArray[Any]) -> PlannedBuffer:
        """Record a shared buffer, which takes memory only on a GPU."""
        if not self.is_cpu:
            return self.empty(name, values.shape, values.dtype)
        return PlannedBuffer(values.shape, values.dtype)

    def fill_zero(self, array: Any) -> None:
        """Do nothing."""

    def wait(self) -> None:
        """Do nothing."""

    def write(self, array: Any, values: NDArray[Any]) -> None:
        """Do nothing."""

    def read(self, array: Any) -> NDArray[Any]:
        """Return zeros in the shape and dtype of the buffer."""
        return np.zeros(array.shape, array.dtype)

    def fetch(self, array: Any) -> Callable[[], NDArray[Any]]:
        """Return a function that returns zeros in the shape and dtype of the buffer."""
        return lambda: self.read(array)
