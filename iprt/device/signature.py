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


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kernel.

    Attributes
    ----------
    name : str
    scalar : numpy type or None
        None: a buffer or a vector.
    words : int
        Components of a number or vector, of four bytes each; 0: a buffer.
    """

    name: str
    scalar: Any
    words: int


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
    *kind, name = re.findall(r"\w+|\*", declaration)
    words = [word for word in kind if word != "const"]
    if "*" in kind:
        return Parameter(name, None, 0)
    return Parameter(name, SCALARS.get(words[0]), int(words[0].lstrip(string.ascii_letters) or 1))
