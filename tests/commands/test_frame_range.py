"""`--frames`: which frames are meant, and what is refused."""

from __future__ import annotations

import pytest

from iprt.commands.frame_range import frame_range
from iprt.errors import IprtError

THERE = range(10, 34)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, THERE),
        (":", THERE),
        ("12:15", range(12, 16)),
        ("12:", range(12, 34)),
        (":12", range(10, 13)),
        ("12:20:4", range(12, 21, 4)),
        ("::5", range(10, 34, 5)),
        ("17", range(17, 18)),
        ("17:17", range(17, 18)),
        ("0012:0013", range(12, 14)),
    ],
)
def test_both_ends_are_meant(text: str | None, expected: range) -> None:
    found = frame_range(text, THERE)
    assert list(found) == list(expected)
    assert found.step == expected.step


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("9:12", "there is no frame 9; the video has 10 to 33"),
        ("12:34", "there is no frame 34; the video has 10 to 33"),
        ("15:12", "comes after the last"),
        ("12:15:0", "the step is 0"),
        ("", "expected FIRST:LAST"),
        ("a:b", "expected FIRST:LAST"),
        ("12-15", "expected FIRST:LAST"),
        ("-1:15", "expected FIRST:LAST"),
        ("1.5", "expected FIRST:LAST"),
        ("12:15:", "expected FIRST:LAST"),
        ("１2", "expected FIRST:LAST"),
        ("9" * 5000, "expected FIRST:LAST"),
    ],
)
def test_what_is_no_range_is_one_line(text: str, message: str) -> None:
    with pytest.raises(IprtError, match=message) as caught:
        frame_range(text, THERE)
    assert "\n" not in str(caught.value)
