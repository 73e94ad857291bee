"""A kernel of one call site, whose arguments stay bound."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from operator import is_, itemgetter
from typing import Any, Protocol

import pyopencl as cl
import pyopencl.array as cla

from iprt.device.bands import Bands
from iprt.device.profile import Kind, Profile
from iprt.device.signature import Parameter

MOST_BOUND = 2
"""OpenCL kernels of a call site: passes that read one of two histories and write the other bind
each way once."""

_Range = tuple[tuple[int, ...], tuple[int, ...]]
_UNBOUND = object()


class Queue(Protocol):
    """The part of `iprt.device.compute.ComputeDevice` that a kernel uses."""

    queue: Any
    profile: Profile
    bands: Bands | None
    building: Callable[[str], None]

    def group_size(self, dimensions: int) -> tuple[int, ...]: ...

    def is_first_launch(self, program: str, kernel: str) -> bool: ...

    def reported(self, what: str) -> AbstractContextManager[None]: ...

    def wait(self) -> None: ...


class _Bound:
    """An OpenCL kernel, and what its parameters are bound to.

    Attributes
    ----------
    buffers, scalars : tuples
        In the order of the parameters of these kinds.
    """

    def __init__(self, kernel: Any, buffers: Sequence[int], scalars: Sequence[tuple[int, Any]]):
        """Indices of the buffers, and those of the scalars with their types."""
        self.kernel = kernel
        self._buffer_indices, self._scalar_indices = buffers, scalars
        self.buffers: tuple[Any, ...] = (_UNBOUND,) * len(buffers)
        self.scalars: tuple[Any, ...] = (_UNBOUND,) * len(scalars)

    def take_buffers(self, buffers: tuple[Any, ...]) -> None:
        for index, new, old in zip(self._buffer_indices, buffers, self.buffers, strict=True):
            if new is not old:
                self.kernel.set_arg(index, new.data if isinstance(new, cla.Array) else new)
        self.buffers = buffers

    def take_scalars(self, scalars: tuple[Any, ...]) -> None:
        for (index, kind), new, old in zip(
            self._scalar_indices, scalars, self.scalars, strict=True
        ):
            if new != old:
                self.kernel.set_arg(index, kind(new))
        self.scalars = scalars


def _getter(names: Sequence[str]) -> Callable[[Mapping[str, Any]], tuple[Any, ...]]:
    """A function that takes the values of these keys."""
    if len(names) > 1:
        return itemgetter(*names)
    return lambda given: tuple(given[name] for name in names)


class Kernel:
    """A built kernel of one call site. Its arguments stay bound from call to call.

    Parameters
    ----------
    device : Queue
    make : callable
        A new `pyopencl.Kernel`, of which nobody else sets arguments.
    program : str
        The name of its program in the profile.
    parameters : sequence of Parameter
        `iprt.device.signature.signature` of the kernel.
    """

    def __init__(
        self,
        device: Queue,
        make: Callable[[], Any],
        program: str,
        parameters: Sequence[Parameter],
    ) -> None:
        self.device = device
        self.program = program
        self.make = make
        self.signature = parameters
        self._indices = (
            [i for i, parameter in enumerate(parameters) if parameter.scalar is None],
            [(i, parameter.scalar) for i, parameter in enumerate(parameters) if parameter.scalar],
        )
        self._buffers = [one.name for one in parameters if one.scalar is None]
        self._get_buffers = _getter(self._buffers)
        self._get_scalars = _getter([one.name for one in parameters if one.scalar is not None])
        self._bound = [_Bound(make(), *self._indices)]  # the last one used comes last
        self.name: str = self._bound[0].kernel.function_name
        self.parameters = [parameter.name for parameter in parameters]
        self._known = frozenset(self.parameters)
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
        device = self.device
        if size != self._size:
            local = device.group_size(len(size))
            rounded = tuple(-(-n // m) * m for n, m in zip(size, local, strict=True))
            self._size, self._range = size, (rounded, local)
        global_size, local = self._range
        first = not self._launched and device.is_first_launch(self.program, self.name)
        self._launched = True
        if first:
            events = [self._launch_first(global_size, local)]
        elif device.bands is not None:
            events = device.bands.launch(
                (self.program, self.name),
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
                profile.record(event, self.name, Kind.KERNEL, size_bytes)

    def run_on(self, device: Queue) -> None:
        """Belong to a device that shares queue and programs with the one that it is of."""
        self.device = device

    @property
    def buffers(self) -> Mapping[str, Any]:
        """Buffers and vectors of the last launch, by parameter."""
        return dict(zip(self._buffers, self._bound[-1].buffers, strict=True))

    def _bind(self, groups: tuple[Mapping[str, Any], ...], own: dict[str, Any]) -> None:
        given: dict[str, Any] = {}
        for group in groups:
            given.update(group)
        given.update(own)
        try:
            buffers, scalars = self._get_buffers(given), self._get_scalars(given)
        except KeyError as error:
            raise TypeError(f"{self._described} is not given {error}") from None
        if not own.keys() <= self._known:
            unknown = ", ".join(own.keys() - self._known)
            raise TypeError(f"{self._described} has no parameter '{unknown}'")
        for bound in self._bound:
            if all(map(is_, buffers, bound.buffers)):
                break
        else:
            bound = self._rebound(buffers)
        if bound.scalars != scalars:
            bound.take_scalars(scalars)
        if bound is not self._bound[-1]:
            self._bound.reverse()

    def _rebound(self, buffers: tuple[Any, ...]) -> _Bound:
        """One that was bound to other buffers, longest ago."""
        if self._launched and len(self._bound) < MOST_BOUND:
            self._bound.insert(0, _Bound(self.make(), *self._indices))
        bound = self._bound[0]
        bound.take_buffers(buffers)
        return bound

    @property
    def _described(self) -> str:
        return f"kernel '{self.name}' of cl/{self.program}"

    def _bound_bytes(self) -> int:
        """Bytes of the buffers that are bound, each counted once."""
        arrays = [value for value in self._bound[-1].buffers if isinstance(value, cla.Array)]
        return sum({id(array): array.nbytes for array in arrays}.values())

    def _enqueue(
        self, size: tuple[int, ...], local: tuple[int, ...], offset: tuple[int, ...] = ()
    ) -> Any:
        # PoCL compiles kernels with an offset anew, also one of zeros.
        start = offset if any(offset) else None
        kernel = self._bound[-1].kernel
        try:
            return cl.enqueue_nd_range_kernel(self.device.queue, kernel, size, local, start)
        except cl.Error as error:
            with self.device.reported(self.name):
                raise error

    def _launch_first(self, size: tuple[int, ...], local: tuple[int, ...]) -> Any:
        """With nothing else on the queue, so that what it takes to compile is seen."""
        device = self.device
        device.building(self.program.partition(" ")[0])
        device.wait()
        start = time.perf_counter()
        event = self._enqueue(size, local)
        device.wait()
        elapsed = (time.perf_counter() - start) * 1e3
        device.profile.launched_first(self.program, event, elapsed)
        return event


class KernelWrapper(Kernel):
    """A kernel that does more when it is called; all else is that of the kernel inside.

    Wrappers may be put around each other.
    """

    def __init__(self, inside: Kernel) -> None:
        self._inside = inside

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inside, name)

    def run_on(self, device: Queue) -> None:
        self._inside.run_on(device)

    def __call__(self, size: tuple[int, ...], *groups: Mapping[str, Any], **own: Any) -> None:
        self._inside(size, *groups, **own)
