"""Parameters of kernels, read from their source.

Not every driver tells the parameters of programs that come from its cache.
"""

from __future__ import annotations

import re
import string
from dataclasses import dataclass
from typing import Any

import numpy as np

from iprt.errors import KernelError
from iprt.files.kernel_source import KernelSource

SCALARS = {"int": np.int32, "uint": np.uint32, "float": np.float32}
QUALIFIERS = ("const", "__global", "__constant", "restrict", "*")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kernel.

    Attributes
    ----------
    name : str
    scalar : numpy type or None
        None: a buffer or a vector.
    kind : str
        What it is, or points to, such as `float4`.
    is_buffer : bool
    """

    name: str
    scalar: Any
    kind: str
    is_buffer: bool

    @property
    def components(self) -> int:
        """Components of a number or vector; 0: a buffer."""
        return 0 if self.is_buffer else int(self.kind.lstrip(string.ascii_letters) or 1)


def signature(source: KernelSource, kernel: str) -> tuple[Parameter, ...]:
    """Return the parameters of a kernel, in order.

    Raises
    ------
    KernelError
        There is no such kernel.
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
