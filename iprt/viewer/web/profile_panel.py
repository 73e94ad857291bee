"""The profile panel: times of the last view frames as a plot, means as a table."""

from __future__ import annotations

import time
from html import escape

import numpy as np

from iprt.viewer.pass_times import WHOLE, PassStatistics, PassTimes
from iprt.viewer.web.browser_state import BrowserState

HEIGHT_PX = 170
COLORS = ("#868e96", "#4dabf7", "#ffa94d", "#69db7c", "#f783ac", "#ffd43b")
EVERY_S = 0.5
"""Interval in seconds between updates, which are large."""
MOST_PASSES = len(COLORS) - 2
"""Largest number of passes with their own line."""


class ProfilePanel:
    """Time per pass as lines and as a table, for use by the window's thread."""

    def __init__(self, browser: BrowserState) -> None:
        self._browser, self._gui = browser, browser.client.gui
        self._pass_times = PassTimes()
        self._lines: list[str] = []
        self._top = 0.0
        self._plot = self._gui.add_uplot(
            (np.arange(2.0), np.zeros(2)),
            ({"label": "step"}, _line("with the host", 0)),
            title="ms per view frame",
            scales={"x": {"time": False}},
            axes=({}, {"size": 64.0}),
            height=HEIGHT_PX,
        )
        self._table = self._gui.add_html("")
        self._due_s = 0.0

    def sync(self) -> None:
        """Add the newest times."""
        displayed = self._browser.displayed
        if (
            displayed is None
            or not self._pass_times.add(displayed.shown)
            or time.monotonic() < self._due_s
        ):
            return
        self._due_s = time.monotonic() + EVERY_S
        rows, series = self._pass_times.table(), self._pass_times.series()
        whole, passes = np.sum(list(series.values()), axis=0), rows[1:]
        # Passes disappear when objects are hidden or the method changes.
        if len(self._lines) < min(len(passes), MOST_PASSES) or not series.keys() >= {*self._lines}:
            self._lines = [row.name for row in passes[:MOST_PASSES]]
            names = ["with the host", WHOLE, *self._lines]
            lines = [_line(name, number) for number, name in enumerate(names)]
            self._plot.series = ({"label": "step"}, *lines)
        top = self._pass_times.top_ms
        if not 0.5 * self._top <= top <= self._top:
            self._top = 1.25 * top
            self._plot.scales = {"x": {"time": False}, "y": {"range": (0.0, self._top)}}
        self._plot.data = (
            self._pass_times.steps.astype(np.float64),
            self._pass_times.wall_ms,
            whole,
            *(series[name] for name in self._lines),
        )
        self._table.content = _table(rows)


def _line(label: str, number: int) -> dict[str, object]:
    points = {"show": False}
    return {"label": label, "stroke": COLORS[number], "width": 1.5, "points": points}


def _table(rows: list[PassStatistics]) -> str:
    names = "".join(f"<td>{name}</td>" for name in ("pass", "mean ms", "p95", "share"))
    lines = "".join(
        f"<tr><td>{escape(row.name)}</td><td>{row.mean_ms:.2f}</td><td>{row.p95_ms:.2f}</td>"
        f"<td>{100 * row.share:.0f} %</td></tr>"
        for row in rows
    )
    head = f"<tr style='opacity:.55'>{names}</tr>"
    style = "width:100%;font-size:.8em;padding:.4em;font-variant-numeric:tabular-nums"
    return f"<table class='profile' style='{style}'>{head}{lines}</table>"
