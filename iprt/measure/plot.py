"""Layout of a small plot, points with error bars and lines, for `report.html` to draw as SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

COLOURS = ("#1f6fb4", "#d9662b", "#3a9447", "#8a5fb0", "#b03a48", "#7a6a52", "#17899c", "#8b8b1a")
TICKS = 6


@dataclass(frozen=True)
class Mark:
    """A point: x, y and the half width of y's interval, in the plot's quantities.

    Attributes
    ----------
    hint : str
        Shown where the pointer rests on it.
    label : str
        Written beside it.
    solid : bool
        Filled, or a ring.
    """

    x: float
    y: float
    half: float = 0.0
    hint: str = ""
    label: str = ""
    solid: bool = True


@dataclass(frozen=True)
class Series:
    """Marks of one colour; `line` are the corners of a line through or beside them."""

    name: str
    marks: tuple[Mark, ...]
    line: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Tick:
    """A line of the grid, at a position in the drawing."""

    at: float
    label: str


@dataclass(frozen=True)
class DrawnMark:
    """A mark in the drawing's units."""

    x: float
    y: float
    low: float
    high: float
    hint: str
    label: str
    solid: bool


@dataclass(frozen=True)
class DrawnSeries:
    """A series in the drawing's units; `line` as SVG's `points`."""

    name: str
    colour: str
    marks: tuple[DrawnMark, ...]
    line: str


@dataclass(frozen=True)
class Plot:
    """A plot with a logarithmic x axis; x > 0. There is at least one mark.

    Attributes
    ----------
    series : tuple of Series
    left, top, right, bottom : float
        Corners of the area inside the axes, in the drawing.
    """

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    notes: tuple[str, ...] = ()
    width: int = 760
    height: int = 420
    left: float = field(default=64.0, init=False)
    top: float = field(default=34.0, init=False)

    @property
    def right(self) -> float:
        return self.width - 30.0

    @property
    def bottom(self) -> float:
        return self.height - 52.0

    @property
    def x_ticks(self) -> list[Tick]:
        low, high = self._x_range()
        return [Tick(round(self._x(value), 1), f"{value:g}") for value in log_ticks(low, high)]

    @property
    def y_ticks(self) -> list[Tick]:
        low, high = self._y_range()
        return [
            Tick(round(self._y(value), 1), f"{value:.10g}") for value in linear_ticks(low, high)
        ]

    @property
    def drawn(self) -> list[DrawnSeries]:
        return [
            DrawnSeries(
                name=series.name,
                colour=COLOURS[index % len(COLOURS)],
                marks=tuple(self._mark(mark) for mark in series.marks),
                line=" ".join(f"{self._x(x):.1f},{self._y(y):.1f}" for x, y in series.line),
            )
            for index, series in enumerate(self.series)
        ]

    def _mark(self, mark: Mark) -> DrawnMark:
        return DrawnMark(
            x=round(self._x(mark.x), 1),
            y=round(self._y(mark.y), 1),
            low=round(self._y(mark.y - mark.half), 1),
            high=round(self._y(mark.y + mark.half), 1),
            hint=mark.hint,
            label=mark.label,
            solid=mark.solid,
        )

    def _marks(self) -> list[Mark]:
        return [mark for series in self.series for mark in series.marks]

    def _x_range(self) -> tuple[float, float]:
        values = [mark.x for mark in self._marks()]
        return min(values) / 1.1, max(values) * 1.1

    def _y_range(self) -> tuple[float, float]:
        marks = self._marks()
        low, high = min(m.y - m.half for m in marks), max(m.y + m.half for m in marks)
        margin = 0.06 * (high - low) or 0.01 * abs(high) or 1.0
        return low - margin, high + margin

    def _x(self, value: float) -> float:
        low, high = self._x_range()
        share = math.log(value / low) / math.log(high / low)
        return self.left + share * (self.right - self.left)

    def _y(self, value: float) -> float:
        low, high = self._y_range()
        return self.bottom - (value - low) / (high - low) * (self.bottom - self.top)


def linear_ticks(low: float, high: float) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between `low` and `high`: about `TICKS`."""
    step = _round_step((high - low) / TICKS)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [index * step for index in range(first, last + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Values for a logarithmic axis: 1, 2, 5 per decade; linear ones where that gives too few."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    values = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
    inside = [value for value in values if low <= value <= high]
    return inside if len(inside) >= 3 else [v for v in linear_ticks(low, high) if v > 0.0]


def _round_step(least: float) -> float:
    power = 10.0 ** math.floor(math.log10(least))
    return next(digit * power for digit in (1, 2, 5, 10) if digit * power >= least * (1 - 1e-9))


def front_line(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Corners of the staircase through points, sorted by x: what is reached by each x."""
    ordered = sorted(points)
    corners: list[tuple[float, float]] = []
    for x, y in ordered:
        if corners:
            corners.append((x, corners[-1][1]))
        corners.append((x, y))
    return tuple(corners)
