"""Run device functions of `cl/lib` on arrays: one work item per row, no kernel file needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.program import Program, build

_SCALARS = {"float": np.float32, "int": np.int32, "uint": np.uint32}


def _scalar_and_width(kind: str) -> tuple[str, int]:
    scalar = kind.rstrip("234")
    return scalar, int(kind[len(scalar) :] or 1)


def _kind(values: NDArray[Any]) -> str:
    names = {np.dtype(t): name for name, t in _SCALARS.items()}
    return names[values.dtype] + (str(values.shape[1]) if values.ndim == 2 else "")


@lru_cache
def _kernel(device: ComputeDevice, source: str, defines: tuple[str, ...]) -> Kernel:
    texts = dict((*define.split("="), "1")[:2] for define in defines)
    program = Program.of_text(source, "run", texts)
    built = build(device.context, program)
    return Kernel(device, lambda: cl.Kernel(built, "run"), "run", "run", program.signature("run"))


def evaluate(
    device: ComputeDevice,
    headers: Sequence[str],
    body: str,
    inputs: Mapping[str, NDArray[Any]],
    outputs: Mapping[str, str],
    tables: Mapping[str, NDArray[np.float32]] | None = None,
    defines: Sequence[str] = (),
    parameters: str = "",
    arguments: Mapping[str, Any] | None = None,
) -> dict[str, NDArray[Any]]:
    """Run statements once per row of the inputs.

    Parameters
    ----------
    headers : names in `cl/lib`.
    body : OpenCL C that reads variables named as the inputs and assigns those of the outputs.
    inputs : (N,) or (N, 2..4) float32, int32 or uint32 each.
    outputs : OpenCL type of each output, e.g. ``{"p": "float2"}``.
    tables : (R, 4) float32 each, a ``__global const float4 *`` of that name.
    defines : names given as ``-D``, or ``NAME=value``.
    parameters, arguments : further parameters of the kernel, such as ``const World world``, and
        what they are given, as to `iprt.device.compute.Kernel`.
    """
    tables = tables or {}
    count = len(next(iter(inputs.values())))
    declared = [f"__global const float4 *restrict {name}" for name in tables]
    loads, stores = [], []
    for name, values in inputs.items():
        scalar, width = _scalar_and_width(_kind(values))
        declared.append(f"__global const {scalar} *restrict {name}_in")
        read = f"vload{width}(row, {name}_in)" if width > 1 else f"{name}_in[row]"
        loads.append(f"{_kind(values)} {name} = {read};")
    for name, kind in outputs.items():
        scalar, width = _scalar_and_width(kind)
        declared.append(f"__global {scalar} *restrict {name}_out")
        loads.append(f"{kind} {name};")
        write = (
            f"vstore{width}({name}, row, {name}_out)" if width > 1 else f"{name}_out[row] = {name}"
        )
        stores.append(write + ";")
    further = [parameters] if parameters else []
    source = "\n".join(
        [
            *(f'#include "{header}"' for header in headers),
            f"__kernel void run({', '.join([*declared, 'const int count', *further])})",
            "{ const int row = get_global_id(0); if (row >= count) return;",
            *loads,
            body,
            *stores,
            "}",
        ]
    )
    kernel = _kernel(device, source, tuple(defines))
    given = {**tables, **{f"{name}_in": values for name, values in inputs.items()}}
    arrays = {
        name: cla.to_device(device.queue, np.ascontiguousarray(v)) for name, v in given.items()
    }
    results = {}
    for name, kind in outputs.items():
        scalar, width = _scalar_and_width(kind)
        shape = (count, width) if width > 1 else (count,)
        results[name] = cla.empty(device.queue, shape, _SCALARS[scalar])
    written = {f"{name}_out": array for name, array in results.items()}
    kernel((count,), arrays, written, arguments or {}, count=count)
    return {name: array.get() for name, array in results.items()}
