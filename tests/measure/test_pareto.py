"""The Pareto front against its definition."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from iprt.measure.pareto import pareto_front

# Few different values, so that ties come up.
NUMBERS = st.integers(0, 4).map(float)


def dominated(point: tuple[float, float], points: list[tuple[float, float]]) -> bool:
    return any(other[0] <= point[0] and other[1] <= point[1] and other != point for other in points)


@given(st.lists(st.tuples(NUMBERS, NUMBERS), max_size=9))
def test_front_is_what_nothing_beats(points: list[tuple[float, float]]) -> None:
    assert pareto_front(points) == [not dominated(point, points) for point in points]
