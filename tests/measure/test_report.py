"""Pages and plots: texts stay texts, marks lie where their numbers say."""

from __future__ import annotations

import base64
from xml.etree import ElementTree

import numpy as np
import pytest

from iprt.measure.plot import SVG, Mark, Plot, Series
from iprt.measure.report import Report
from iprt.output.grid import Grid


def test_texts_of_users_are_no_markup() -> None:
    report = Report("<b>room</b>", grids=[Grid("<i>", ("<u>",), (("a&b",),))])
    page = report.html()
    assert "<b>" not in page
    assert "&lt;b&gt;room&lt;/b&gt;" in page
    assert "<i>" not in page
    assert "<u>" not in page
    assert "a&amp;b" in page


def drawn(plot: Plot) -> dict[str, tuple[float, float]]:
    """Where each mark lies in the file, from its left and its top, by its hint."""
    head, _, data = plot.data.partition(",")
    assert head == "data:image/svg+xml;base64"
    root = ElementTree.fromstring(base64.b64decode(data))
    return {
        str(group[0].text): (float(used.get("x", "")), float(used.get("y", "")))
        for group in root.iter(f"{{{SVG}}}g")
        if len(group) and group[0].tag == f"{{{SVG}}}title"
        for used in group.iter(f"{{{SVG}}}use")
    }


def test_marks_lie_where_their_numbers_say() -> None:
    marks = tuple(Mark(x, y, 0.1, str(x)) for x, y in ((1.0, 0.5), (10.0, 0.7), (100.0, 0.9)))
    at = drawn(Plot("t", "x", "y", (Series("s", marks),)))
    (left, low), (middle, between), (right, high) = at["1.0"], at["10.0"], at["100.0"]
    assert left < right
    assert high < low, "rows are counted from the top"
    assert middle == pytest.approx((left + right) / 2, abs=0.2), "logarithmic"
    assert between == pytest.approx((low + high) / 2, abs=0.2), "linear"


@pytest.mark.parametrize("x", [[3.0], [10.3, 13.9], [1e-3, 1e4]])
def test_axes_say_round_numbers_within_the_plot(x: list[float]) -> None:
    axes = Plot("t", "x", "y", (Series("", tuple(Mark(v, 1.0) for v in x)),)).figure().axes[0]
    low, high = axes.get_xlim()
    assert low < min(x) <= max(x) < high
    shown = [float(tick.get_text()) for tick in axes.get_xticklabels()]
    within = [value for value in shown if low <= value <= high]
    assert 2 <= len(within) <= 40
    assert within == sorted(within)
    assert all(float(f"{value:.3g}") == value for value in within)


def test_a_front_rises_in_steps_through_solid_marks() -> None:
    marks = (Mark(4.0, 0.9), Mark(1.0, 0.5), Mark(2.0, 0.4, solid=False))
    line = Plot("t", "x", "y", (Series("", marks, steps=True),)).figure().axes[0].lines[0]
    assert line.get_drawstyle() == "steps-post"
    np.testing.assert_array_equal(line.get_xydata(), [(1.0, 0.5), (4.0, 0.9)])


def test_the_same_plot_is_the_same_file() -> None:
    plots = [Plot("t", "x", "y", (Series("", (Mark(3.0, 1.0, 0.1, "h"),)),)) for _ in range(2)]
    assert plots[0].data == plots[1].data
