"""Files that are damaged anywhere: still right, or one error for the user; never anything else.

`tests/fuzz/` does the same for longer, guided by coverage.
"""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.seeds import TARGETS, right
from tests.fuzz.targets import Reading

EXAMPLES = {"scene": 40, "exr": 60, "gltf": 60, "glb": 60}
"""Targets whose files take long to read have fewer; the others have 100."""
WORDS = (b"\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"\xff\xff\xff\x7f", bytes(4), b"nan", b"1e999")
"""What breaks sizes and numbers."""

Damage = tuple[str, float, int, bytes]


def damages() -> st.SearchStrategy[list[Damage]]:
    """What is done to a file: kind, place from 0 to 1, length, bytes."""
    word = st.sampled_from(WORDS) | st.binary(min_size=1, max_size=8)
    kinds = st.sampled_from(["flip", "put", "insert", "remove", "repeat", "cut", "splice"])
    one = st.tuples(kinds, st.floats(0.0, 1.0), st.integers(1, 64), word)
    return st.lists(one, min_size=1, max_size=4)


def damaged(data: bytes, steps: list[Damage], other: bytes) -> bytes:
    for kind, place, length, word in steps:
        at = int(place * max(len(data) - 1, 0))
        before, after = data[:at], data[at:]
        if kind == "flip" and after:
            data = before + bytes([after[0] ^ 1 << length % 8]) + after[1:]
        elif kind == "put":
            data = before + word + after[len(word) :]
        elif kind == "insert":
            data = before + word + after
        elif kind == "remove":
            data = before + after[length:]
        elif kind == "repeat":
            data = before + after[:length] * 9 + after[length:]
        elif kind == "cut":
            data = before
        elif kind == "splice":
            data = before + other[int(place * len(other)) :]
    return data


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_damaged_files_are_read_or_refused(target: str) -> None:
    reading, files = Reading(target), right(target)

    @settings(max_examples=EXAMPLES.get(target, 100), derandomize=True)
    @given(st.sampled_from(files), damages(), st.sampled_from(files))
    def check(data: bytes, steps: list[Damage], other: bytes) -> None:
        reading(damaged(data, steps, other))

    check()


@pytest.mark.parametrize("target", TARGETS)
def test_the_files_to_start_with_are_right(target: str) -> None:
    reading = Reading(target)
    assert all(reading(data) for data in right(target))
