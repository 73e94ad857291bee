"""Parameters and grids of kernels, parsed from their source.

Some drivers do not report the parameters of cached programs.
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from iprt.errors import KernelError

SCALARS = {"int": np.int32, "uint": np.uint32, "float": np.float32}
_LINES = re.DOTALL | re.MULTILINE
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


def signature(text: str, kernel: str) -> tuple[Parameter, ...]:
    """Parse the parameters of a kernel in resolved source, in order.

    Raises
    ------
    KernelError
        The source has no such kernel.
    """
    parameters, _ = _parts(text, kernel)
    return tuple(_parameter(one, _names(text)) for one in parameters.split(","))


@cache
def _names(text: str) -> dict[str, str]:
    """Return macros: types of buffers may have names, `PLANES_IN __global const float *`."""
    return dict(re.findall(r"^ *#define (\w+) (\w.*)$", text, re.MULTILINE))


def dimensions(text: str, kernel: str) -> int:
    """Return the dimensions of a kernel's grid: 3 if it runs over tiles or entries, else 2.

    A kernel of one dimension counts as one of two, which has the same work group.

    Raises
    ------
    KernelError
        The source has no such kernel.
    """
    _, body = _parts(text, kernel)
    return 3 if re.search(r"\bTILE_ITEM\b|\bget_global_id\(2\)", body) else 2


def _parts(text: str, kernel: str) -> tuple[str, str]:
    """Return the declared parameters and the body of a kernel in resolved source."""
    # A pattern that begins with letters is found several times as fast.
    found = re.search(rf"void\s+{kernel}\s*\(([^{{]*)\)\s*\{{(.*?)(?:^\}}|\Z)", text, _LINES)
    if found is None:
        raise KernelError(f"no kernel '{kernel}'")
    return found[1], found[2]


def _parameter(declaration: str, names: Mapping[str, str]) -> Parameter:
    first, _, rest = declaration.strip().partition(" ")
    if first in names:
        return _parameter(f"{names[first]} {rest}", names)
    *words, name = re.findall(r"\w+|\*", declaration)
    kind = next(word for word in words if word not in QUALIFIERS)
    is_buffer = "*" in words
    return Parameter(name, None if is_buffer else SCALARS.get(kind), kind, is_buffer)
