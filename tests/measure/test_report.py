"""Pages and plots: texts stay texts, marks lie where their numbers say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iprt.measure.plot import Mark, Plot, Series, front_line, linear_ticks, log_ticks
from iprt.measure.report import Report
from iprt.output.grid import Grid

VALUES = st.floats(1e-3, 1e4)


def test_texts_of_users_are_no_markup() -> None:
    report = Report("<b>room</b>", grids=[Grid("<i>", ("<u>",), (("a&b",),))])
    page = report.html()
    assert "<b>" not in page
    assert "&lt;b&gt;room&lt;/b&gt;" in page
    assert "<i>" not in page
    assert "<u>" not in page
    assert "a&amp;b" in page


@given(VALUES, st.floats(1.001, 1e4))
def test_ticks_are_round_and_within(low: float, ratio: float) -> None:
    for values in (linear_ticks(low, low * ratio), log_ticks(low, low * ratio)):
        assert 2 <= len(values) <= 40
        assert values == sorted(values)
        assert low * (1 - 1e-6) <= values[0]
        assert values[-1] <= low * ratio * (1 + 1e-6)
    steps = np.diff(linear_ticks(low, low * ratio))
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
    mantissa = float(f"{steps[0]:e}".partition("e")[0])
    assert mantissa == pytest.approx(1) or mantissa == pytest.approx(2) or mantissa in (5, 10)


def test_marks_lie_where_their_numbers_say() -> None:
    marks = (Mark(1.0, 0.5, 0.1), Mark(10.0, 0.7), Mark(100.0, 0.9, 0.1))
    plot = Plot("t", "x", "y", (Series("s", marks, front_line([(1.0, 0.5), (100.0, 0.9)])),))
    (drawn,) = plot.drawn
    first, middle, last = drawn.marks
    assert plot.left < first.x < last.x < plot.right
    assert middle.x == pytest.approx((first.x + last.x) / 2, abs=0.2), "logarithmic"
    assert middle.y == pytest.approx((first.y + last.y) / 2, abs=0.2), "linear"
    assert plot.top <= last.high < last.y < middle.y < first.y < first.low <= plot.bottom
    assert drawn.line == f"{first.x},{first.y} {last.x},{first.y} {last.x},{last.y}"


def test_one_mark_alone_can_be_drawn() -> None:
    plot = Plot("t", "x", "y", (Series("", (Mark(3.0, 1.0),)),))
    assert plot.left < plot.drawn[0].marks[0].x < plot.right
    assert plot.y_ticks
    assert plot.x_ticks
