"""Which of several trades of cost against error are worth making."""

from __future__ import annotations

import math
from collections.abc import Sequence


def pareto_front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """For each point (cost, error): no other is as good in both and better in one."""
    on_front = [False] * len(points)
    least, cost_of_least = math.inf, math.inf
    for index in sorted(range(len(points)), key=lambda i: points[i]):
        cost, error = points[index]
        # Equal points stand together in this order, and neither beats the other.
        if error < least or (error == least and cost == cost_of_least):
            on_front[index], least, cost_of_least = True, error, cost
    return on_front
