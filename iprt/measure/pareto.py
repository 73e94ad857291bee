"""Pareto front of cost and error."""

from __future__ import annotations

import math
from collections.abc import Sequence


def pareto_front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Mark the points (cost, error) that no other point dominates.

    A point dominates another if it is no worse in both and better in one.
    """
    on_front = [False] * len(points)
    lowest, cost_of_lowest = math.inf, math.inf
    for index in sorted(range(len(points)), key=lambda i: points[i]):
        cost, error = points[index]
        # Equal points are adjacent in this order and do not dominate each other.
        if error < lowest or (error == lowest and cost == cost_of_lowest):
            on_front[index], lowest, cost_of_lowest = True, error, cost
    return on_front
