"""A kernel of one call site, which keeps its arguments bound between launches."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import AbstractContextManager
from operator import is_, itemgetter
from typing import Any, Protocol, Self

import pyopencl as cl
import pyopencl.array as cla

from iprt.device.bands import Bands
from iprt.device.block import Block
from iprt.device.profile import Kind, Profile
from iprt.device.signature import Parameter

MOST_BOUND = 2
"""Number of OpenCL kernels per call site. Passes that swap two history buffers bind each order
once. More kernels would keep buffers of closed views alive."""

_Bindable = tuple[int, Any]
"""Index of a parameter, and numpy type of a scalar. None: a buffer or a vector."""
_Range = tuple[tuple[int, ...], tuple[int, ...]]
_UNBOUND = object()


class Queue(Protocol):
    """Interface of `iprt.device.compute.ComputeDevice` used by a kernel."""

    queue: Any
    profile: Profile
    bands: Bands | None
    building: Callable[[str], None]

    def group_size(self, dimensions: int) -> tuple[int, ...]:
        """Return the work-group size."""

    def is_first_launch(self, program: str, kernel: str) -> bool:
        """Return True at the first call for this kernel, False later."""

    def reported(self, what: str) -> AbstractContextManager[None]:
        """Translate OpenCL errors of a `with` block."""

    def wait(self) -> None:
        """Wait until all enqueued work is done."""


class _Bound:
    """An OpenCL kernel with the current values of its varying parameters.

    Attributes
    ----------
    buffers, scalars : tuples
        Bound values, in the order of the varying parameters of each kind.
    """

    def __init__(self, kernel: Any, buffers: int, scalars: int) -> None:
        """Start without values; `buffers` and `scalars` count the varying parameters."""
        self.kernel = kernel
        self.buffers: tuple[Any, ...] = (_UNBOUND,) * buffers
        self.scalars: tuple[Any, ...] = (_UNBOUND,) * scalars

    def take(self, parameter: _Bindable, value: Any) -> None:
        """Bind a parameter."""
        index, scalar = parameter
        if scalar is not None:
            value = scalar(value)
        elif isinstance(value, cla.Array):
            value = value.data
        self.kernel.set_arg(index, value)

    def take_buffers(self, parameters: Sequence[_Bindable], buffers: tuple[Any, ...]) -> None:
        """Bind the buffers that differ from the bound ones, by identity."""
        for parameter, new, old in zip(parameters, buffers, self.buffers, strict=True):
            if new is not old:
                self.take(parameter, new)
        self.buffers = buffers

    def take_scalars(self, parameters: Sequence[_Bindable], scalars: tuple[Any, ...]) -> None:
        """Bind the scalars that differ from the bound ones."""
        for parameter, new, old in zip(parameters, scalars, self.scalars, strict=True):
            if new != old:
                self.take(parameter, new)
        self.scalars = scalars


def _getter(names: Sequence[str]) -> Callable[[Mapping[str, Any]], tuple[Any, ...]]:
    """Return a function that looks up the values of these keys as a tuple."""
    if len(names) > 1:
        return itemgetter(*names)
    return lambda given: tuple(given[name] for name in names)


def _merged(groups: tuple[Mapping[str, Any], ...], own: Mapping[str, Any]) -> dict[str, Any]:
    """Merge arguments, by the names of flat parameters."""
    given: dict[str, Any] = {}
    for group in groups:
        given.update(group)
    given.update(own)
    for name, value in list(given.items()):
        if isinstance(value, Block):
            given.update(value.arguments(name))
    return given


def fitting(group: tuple[int, ...], most: int) -> tuple[int, ...]:
    """Shrink a work group to at most `most` work items, by halving its longest side repeatedly.

    Sides are powers of two.
    """
    sides = list(group)
    while math.prod(sides) > max(most, 1):
        longest = sides.index(max(sides))
        sides[longest] //= 2
    return tuple(sides)


class Kernel:
    """A kernel of one call site. Its arguments stay bound from call to call.

    Parameters
    ----------
    device : Queue
    make : callable
        Returns a new `pyopencl.Kernel`, not shared with other call sites.
    name : str
        Name of the kernel.
    program : str
        Name of its program in the profile.
    parameters : sequence of Parameter
        `iprt.device.signature.signature` of the kernel.
    """

    def __init__(
        self,
        device: Queue,
        make: Callable[[], Any],
        name: str,
        program: str,
        parameters: Sequence[Parameter],
    ) -> None:
        self.device = device
        self.name, self.program = name, program
        self.make = make
        self.signature = parameters
        self.parameters = [parameter.name for parameter in parameters]
        self._bindable = {one.name: (i, one.scalar) for i, one in enumerate(parameters)}
        self._fixed: dict[str, Any] = {}
        self._bound: list[_Bound] = []  # least recently used first
        self._divide()
        self._size: tuple[int, ...] = ()
        self._range: _Range = ((), ())
        self._launched = False

    def __call__(self, size: tuple[int, ...], *groups: Mapping[str, Any], **own: Any) -> None:
        """Enqueue the kernel over `size` work items, x first.

        The grid is rounded up to whole work groups, so the kernel must check its bounds.

        Parameters
        ----------
        size : tuple of int
        groups : mappings of str to object
            Arguments shared by several kernels, by parameter name. Names that are not parameters
            of this kernel are ignored. Blocks, ints and floats, arrays for buffers, None for a null
            pointer.
        own : object
            Arguments of this kernel only, by parameter name.

        Raises
        ------
        TypeError
            A parameter has no argument, or `own` names an unknown parameter.
        """
        assert min(size) > 0, (self.name, size)  # OpenCL before 2.1 refuses an empty range
        self._bind(groups, own)
        device = self.device
        if size != self._size:
            local = fitting(device.group_size(len(size)), self._largest_group())
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

    def fixed(self, *groups: Mapping[str, Any], **own: Any) -> Self:
        """Bind arguments for all launches and return the kernel. Launches then pass the rest.

        Raises
        ------
        TypeError
            `own` names an unknown parameter.
        """
        assert not self._bound, "before the first launch"
        self._require_known(own, self._bindable)
        given = _merged(groups, own)
        self._fixed |= {name: value for name, value in given.items() if name in self._bindable}
        self._divide()
        return self

    def _divide(self) -> None:
        """Split the parameters into fixed ones, varying buffers and varying scalars."""
        varying = {name: one for name, one in self._bindable.items() if name not in self._fixed}
        self._varying = frozenset(varying)
        self._buffers = [name for name, (_, scalar) in varying.items() if scalar is None]
        self._scalars = [name for name, (_, scalar) in varying.items() if scalar is not None]
        self._get_buffers, self._get_scalars = _getter(self._buffers), _getter(self._scalars)

    def _require_known(self, own: Mapping[str, Any], known: Collection[str]) -> None:
        unknown = [n for n, value in own.items() if n not in known and not isinstance(value, Block)]
        if unknown:
            raise TypeError(f"{self._described} has no parameter '{', '.join(unknown)}'")

    def run_on(self, device: Queue) -> None:
        """Move the kernel to another device that shares its queue and programs."""
        self.device = device

    @property
    def buffers(self) -> Mapping[str, Any]:
        """Buffers and vectors of the last launch, by parameter name."""
        fixed = {
            name: value for name, value in self._fixed.items() if self._bindable[name][1] is None
        }
        return fixed | dict(zip(self._buffers, self._bound[-1].buffers, strict=True))

    def _bind(self, groups: tuple[Mapping[str, Any], ...], own: dict[str, Any]) -> None:
        given = _merged(groups, own)
        try:
            buffers, scalars = self._get_buffers(given), self._get_scalars(given)
        except KeyError as error:
            raise TypeError(f"{self._described} is not given {error}") from None
        for bound in self._bound:
            if all(map(is_, buffers, bound.buffers)):
                break
        else:
            self._require_known(own, self._varying)
            bound = self._rebound(buffers)
        if bound.scalars != scalars:
            bound.take_scalars([self._bindable[name] for name in self._scalars], scalars)
        if bound is not self._bound[-1]:
            self._bound.reverse()

    def _rebound(self, buffers: tuple[Any, ...]) -> _Bound:
        """Bind buffers to a new OpenCL kernel, or beyond `MOST_BOUND` to the oldest one."""
        if len(self._bound) < MOST_BOUND:
            new = _Bound(self.make(), len(self._buffers), len(self._scalars))
            for name, value in self._fixed.items():
                new.take(self._bindable[name], value)
            self._bound.insert(0, new)
        bound = self._bound[0]
        bound.take_buffers([self._bindable[name] for name in self._buffers], buffers)
        return bound

    def _largest_group(self) -> int:
        """Return the largest work group of this kernel, limited by its use of registers."""
        what = cl.kernel_work_group_info.WORK_GROUP_SIZE
        most: int = self._bound[-1].kernel.get_work_group_info(what, self.device.queue.device)
        return most

    @property
    def _described(self) -> str:
        return f"kernel '{self.name}' of cl/{self.program}"

    def _bound_bytes(self) -> int:
        """Sum the bytes of the bound buffers, each counted once."""
        arrays = [value for value in self.buffers.values() if isinstance(value, cla.Array)]
        return sum({id(array): array.nbytes for array in arrays}.values())

    def _enqueue(
        self, size: tuple[int, ...], local: tuple[int, ...], offset: tuple[int, ...] = ()
    ) -> Any:
        # PoCL compiles a kernel again for a launch with an offset, even if it is zero.
        start = offset if any(offset) else None
        kernel = self._bound[-1].kernel
        try:
            return cl.enqueue_nd_range_kernel(self.device.queue, kernel, size, local, start)
        except cl.Error as error:
            with self.device.reported(self.name):
                raise error

    def _launch_first(self, size: tuple[int, ...], local: tuple[int, ...]) -> Any:
        """Launch on an empty queue, so that the compile time can be measured."""
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
    """Base class of kernels that add to the launch of an inner kernel. Wrappers can be nested."""

    def __init__(self, inside: Kernel) -> None:
        self._inside = inside

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inside, name)

    def fixed(self, *groups: Mapping[str, Any], **own: Any) -> Self:
        """Bind arguments of the inner kernel for all launches."""
        self._inside.fixed(*groups, **own)
        return self

    def run_on(self, device: Queue) -> None:
        """Move the inner kernel to another device."""
        self._inside.run_on(device)

    def __call__(self, size: tuple[int, ...], *groups: Mapping[str, Any], **own: Any) -> None:
        """Enqueue the inner kernel."""
        self._inside(size, *groups, **own)
