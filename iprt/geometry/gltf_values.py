"""Numeric data of a glTF file's accessors (Khronos glTF 2.0, sections 3.6.2 and 3.11)."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from iprt.geometry.animation import Float
from iprt.geometry.gltf_check import accessor_of
from iprt.geometry.gltf_document import Gltf

_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Buffered(Protocol):
    """A glTF document with its buffers."""

    @property
    def gltf(self) -> Gltf | None:
        """The checked document; None for another file format."""

    def buffer(self, number: int) -> bytes:
        """Return the bytes of a buffer."""


def values_of(file: Buffered, index: int, types: tuple[str, ...], where: str) -> Float:
    """Return the data of an accessor; normalised integers become fractions.

    Parameters
    ----------
    index : int
        Index of the accessor.
    types : tuple of str
        Allowed glTF types.
    where : str
        Referring part of the document, for error messages.

    Returns
    -------
    (count, columns) float64
        Finite. Matrices are rows of 16, column-major.

    Raises
    ------
    ValueError
        The accessor has another type, is missing, exceeds its buffer or is not finite.
    """
    gltf = file.gltf
    assert gltf is not None
    accessor = accessor_of(gltf, index, types, where)
    assert accessor.buffer_view is not None
    # gltf_check.py has checked that accessors lie in views, and views in the declared buffers.
    view = gltf.buffer_views[accessor.buffer_view]
    data = file.buffer(view.buffer)
    if view.byte_offset + view.byte_length > len(data):
        raise ValueError(f"{where}: buffer {view.buffer} is cut off")
    dtype = np.dtype(_DTYPES[accessor.component_type])
    stored = np.ndarray(
        (accessor.count, _COLUMNS[accessor.type]),
        dtype,
        data,
        view.byte_offset + accessor.byte_offset,
        (view.byte_stride or accessor.item_bytes, dtype.itemsize),
    )
    values = stored.astype(np.float64)
    if accessor.normalized and dtype.kind in "iu":
        values = np.maximum(values / np.iinfo(dtype).max, -1.0)
    if not np.isfinite(values).all():
        raise ValueError(f"{where}: holds NaN or infinity")
    return values
