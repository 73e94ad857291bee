"""A device that checks what is written on it.

Kernels in OpenCL C may write anywhere and anything. Here every buffer lies between two guards, and
after each launch the buffers that the kernel may have written are read back: a NaN, an infinity or
a touched guard raises an error of one line that names pass, kernel, buffer and place.

What no one has written yet, and the guards, hold `POISON`, a signalling NaN. Arithmetic turns it
into a quiet one. So a kernel that computes with what it read beside a buffer, or before anything
was written there, is found by the NaN that it writes; a place that stays unwritten is no fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.array as cla
from numpy.typing import DTypeLike, NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel, KernelWrapper
from iprt.device.program import Define

POISON = 0x7FAD
"""Repeated in every two bytes: float32 of exponent 255 without the quiet bit, float16 NaN."""

GUARD_BYTES = 4096
"""Before and after each buffer: more than any device asks of the origin of a sub-buffer."""

INFINITE: Mapping[str, str] = {
    "panorama.depth": "open sky is infinitely far",
    "panorama.range": "the same; cl/world/real/surface.cl",
    "panorama.background depth": "open sky is infinitely far",
    "panorama.background around": "the same; cl/world/real/remember.cl",
    "panorama.background range": "the same; cl/world/real/background.cl",
    "screen layers range": "where there is no object; cl/world/objects/object_surface.cl",
    "equirect layers range": "the same",
    "real highlight": "all of what metal shows is highlight; cl/compositing/real_layer.cl",
    "light highlight": "the same, at light's resolution",
}
"""Buffers that may hold infinities, and why."""

BITS: Mapping[str, str] = {"bvh nodes": "references to nodes are integers, iprt/bvh/wide.py"}
"""Buffers of floats of which some are none, and why."""


class DefectError(Exception):
    """A kernel wrote what it must not."""


class GuardedArray(cla.Array):  # type: ignore[misc]
    """A buffer between guards, which are part of the bytes of `whole`."""

    name: str
    whole: cla.Array


class CheckedDevice(ComputeDevice):
    """Shares everything with `device` but the buffers that are made here.

    Raises
    ------
    DefectError
        In `write` and when kernels are called: what was written is wrong.
    """

    def __init__(self, device: ComputeDevice) -> None:
        vars(self).update(vars(device))
        self._inside = device

    def kernel(
        self,
        file: str,
        name: str,
        defines: Mapping[str, Define] | None = None,
        **hints: Any,
    ) -> Kernel:
        return CheckedKernel(self, self._inside.kernel(file, name, defines, **hints), file)

    def empty(
        self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32
    ) -> GuardedArray:
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        whole = self._inside.empty(name, (_guarded_bytes(size),), np.uint8)
        cl.enqueue_fill_buffer(self.queue, whole.data, np.uint16(POISON), 0, whole.nbytes)
        inside = whole.data.get_sub_region(GUARD_BYTES, whole.nbytes - 2 * GUARD_BYTES)
        array = GuardedArray(self.queue, shape, dtype, data=inside)
        array.name, array.whole = name, whole
        return array

    def zeros(
        self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32
    ) -> GuardedArray:
        array = self.empty(name, shape, dtype)
        self.fill_zero(array)
        return array

    def share(self, name: str, values: NDArray[Any]) -> cla.Array:
        """A copy, between guards."""
        return self.upload(name, values)

    def write(self, array: cla.Array, values: NDArray[Any]) -> None:
        super().write(array, values)
        # A part of a buffer has no name. It is checked when a kernel next writes the whole.
        if isinstance(array, GuardedArray) and hasattr(array, "name"):
            self.check("the host", array)

    def check(self, writer: str, array: GuardedArray) -> None:
        """Check a buffer that `writer` may have written.

        Raises
        ------
        DefectError
            Its guards are not what they were, or it holds NaN or infinity.
        """
        whole = self.read(array.whole)
        found = _stray_write(whole, array) or _not_finite(whole, array)
        if found:
            raise DefectError(f"pass '{self.profile.current}': {writer} {found} ({self.name})")


class CheckedKernel(KernelWrapper):
    """A kernel whose launches are checked."""

    def __init__(self, device: CheckedDevice, kernel: Kernel, file: str) -> None:
        super().__init__(kernel)
        self._checks = device
        self._writer = f"kernel '{self.name}' of cl/{file}"
        made = self.make()
        self._written = [
            parameter.name
            for i, parameter in enumerate(self.signature)
            if parameter.scalar is None and _may_write(made, i)
        ]

    def __call__(self, size: tuple[int, ...], *groups: Mapping[str, Any], **own: Any) -> None:
        super().__call__(size, *groups, **own)
        buffers = self.buffers
        for name in self._written:
            if isinstance(buffers[name], GuardedArray):
                self._checks.check(self._writer, buffers[name])


def _may_write(kernel: cl.Kernel, index: int) -> bool:
    """Whether a parameter may be written through, for all that the driver tells."""
    try:
        qualifier = kernel.get_arg_info(index, cl.kernel_arg_info.TYPE_QUALIFIER)
    except cl.RuntimeError:  # Intel's CPU runtime does not know it of a program from a cache
        return True
    return not qualifier & cl.kernel_arg_type_qualifier.CONST


def _guarded_bytes(size: int) -> int:
    """Bytes of a buffer of `size`, filled up to whole words, with its guards."""
    return GUARD_BYTES + -(-size // 4) * 4 + GUARD_BYTES


def _stray_write(whole: NDArray[np.uint8], array: GuardedArray) -> str:
    """Which guard was written, if any."""
    first, end = GUARD_BYTES, GUARD_BYTES + array.nbytes
    untouched = np.resize(np.array([POISON], np.uint16).view(np.uint8), whole.size)
    touched = np.flatnonzero(whole != untouched)
    before, after = touched[touched < first], touched[touched >= end]
    if before.size:
        count = -(-(first - int(before[-1])) // array.dtype.itemsize)
        return f"wrote to '{array.name}' {count} before its first element"
    if after.size:
        count = (int(after[0]) - end) // array.dtype.itemsize + 1
        return f"wrote to '{array.name}' {count} past its last element"
    return ""


def _not_finite(whole: NDArray[np.uint8], array: GuardedArray) -> str:
    """The first element that is NaN or infinite and may not be, if any."""
    if array.dtype.kind != "f" or array.name in BITS:
        return ""
    bits = whole[GUARD_BYTES : GUARD_BYTES + array.nbytes]
    values = bits.view(array.dtype)
    bad = np.isnan(values) if array.name in INFINITE else ~np.isfinite(values)
    if not bad.any():
        return ""
    words = bits.view(np.uint16).reshape(values.size, -1)
    places = np.flatnonzero(bad & (words != POISON).any(axis=1))
    if not places.size:
        return ""
    index = ", ".join(str(i) for i in np.unravel_index(places[0], array.shape))
    more = f", the first of {places.size}" if places.size > 1 else ""
    return f"wrote {values[places[0]]} to '{array.name}' at [{index}]{more}"
