"""Parameters of kernels, parsed from their source.

Some drivers do not report the parameters of cached programs.
"""

from __future__ import annotations

import re
import string
from dataclasses import dataclass
from typing import Any

import numpy as np

from iprt.device.kernel_source import KernelSource
from iprt.errors import KernelError

SCALARS = {"int": np.int32, "uint": np.uint32, "float": np.float32}
QUALIFIERS = ("const", "__global", "__constant", "restrict", "*")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kernel.

    Attributes
    ----------
    name : str
    scalar : numpy type or None
        Type of a scalar. None: a buffer or a vector.
    kind : str
        OpenCL type of the value, or of a buffer's elements, such as `float4`.
    is_buffer : bool
    """

    name: str
    scalar: Any
    kind: str
    is_buffer: bool

    @property
    def components(self) -> int:
        """Number of components of a scalar or vector; 0 for a buffer."""
        return 0 if self.is_buffer else int(self.kind.lstrip(string.ascii_letters) or 1)


def signature(source: KernelSource, kernel: str) -> tuple[Parameter, ...]:
    """Parse the parameters of a kernel, in order.

    Raises
    ------
    KernelError
        The source has no such kernel.
    """
    text = source.text
    start = re.search(rf"\bvoid\s+{kernel}\s*\(", text)
    if start is None:
        raise KernelError(f"no kernel '{kernel}'")
    depth, end = 1, start.end()
    while depth:
        depth += {"(": 1, ")": -1}.get(text[end], 0)
        end += 1
    lines = text[start.end() : end - 1].splitlines()
    declared = " ".join(" ".join(line for line in lines if not line.startswith("#line")).split())
    return tuple(_parameter(one) for one in source.expanded(declared).split(","))


def _parameter(declaration: str) -> Parameter:
    *words, name = re.findall(r"\w+|\*", declaration)
    kind = next(word for word in words if word not in QUALIFIERS)
    is_buffer = "*" in words
    return Parameter(name, None if is_buffer else SCALARS.get(kind), kind, is_buffer)
