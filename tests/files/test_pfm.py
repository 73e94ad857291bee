"""PFM: both byte orders, bottom row first."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from iprt.errors import FormatError
from iprt.files.images import read_depth


@settings(max_examples=60)
@given(
    values=arrays(np.float32, array_shapes(min_dims=2, max_dims=2, max_side=9)),
    little=st.booleans(),
    separator=st.sampled_from([b" ", b"\n", b"\t"]),
)
def test_values_survive(
    tmp_path_factory: pytest.TempPathFactory,
    values: np.ndarray,
    little: bool,
    separator: bytes,
) -> None:
    height, width = values.shape
    body = b"".join(
        struct.pack(("<" if little else ">") + f"{width}f", *row) for row in reversed(values)
    )
    header = b"Pf\n%d%s%d\n%s\n" % (width, separator, height, b"-1.0" if little else b"2.5")
    path = tmp_path_factory.mktemp("pfm") / "d.pfm"
    path.write_bytes(header + body)
    depth, integers = read_depth(path)
    assert not integers
    assert np.array_equal(depth, values, equal_nan=True)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"PF\n1 1\n-1\n" + bytes(12), "three channels"),
        (b"Pf\n100000 100000\n-1\n", "at most"),
        (b"Pf\n0 4\n-1\n", "at most"),
        (b"Pf\n4 2\n-1\n" + bytes(31), "31 of 32 bytes"),
        (b"Pf\n4 2\n0\n" + bytes(32), "scale"),
        (b"Pf\n4 2\nnan\n" + bytes(32), "scale"),
        (b"Pf\n4 2\nx\n" + bytes(32), "scale"),
        (b"Pf\n4\n", "no header"),
    ],
)
def test_bad_files_are_one_line(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "d.pfm"
    path.write_bytes(data)
    with pytest.raises(FormatError, match=message) as error:
        read_depth(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
