"""Where the time of a view frame goes: the last ones as a plot, their medians as a table."""

from __future__ import annotations

from collections import deque
from html import escape
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from iprt.device.profile import PassTime

if TYPE_CHECKING:
    from iprt.viewer.web.browser import Browser

FRAMES = 200


class ProfilePanel:
    """Of the window's thread."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._frames: deque[tuple[int, float, tuple[PassTime, ...]]] = deque(maxlen=FRAMES)
        gui = browser.client.gui
        steps = np.arange(2.0)
        self._plot = gui.add_uplot(
            (steps, np.zeros(2), np.zeros(2)),
            ({"label": "frame"}, _series("device", "#4dabf7"), _series("with the host", "#ffa94d")),
            title="ms per view frame",
            height=170,
        )
        self._table = gui.add_html("")

    def sync(self) -> None:
        sight = self._browser.sight
        if sight is None or (self._frames and self._frames[-1][0] == sight.shown.step):
            return
        shown = sight.shown
        self._frames.append((shown.step, 1000.0 * shown.seconds, shown.passes))
        if len(self._frames) > 1:
            self._plot.data = (
                np.array([step for step, _, _ in self._frames], np.float64),
                np.array([sum(p.ms for p in passes) for _, _, passes in self._frames]),
                np.array([ms for _, ms, _ in self._frames]),
            )
        self._table.content = self._rows()

    def _rows(self) -> str:
        times: dict[str, list[float]] = {}
        for _, _, passes in self._frames:
            for entry in passes:
                times.setdefault(entry.name, []).append(entry.ms)
        medians = {name: median(values) for name, values in times.items()}
        total = sum(medians.values()) or 1.0
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td align='right'>{ms:.2f}</td>"
            f"<td align='right'>{np.percentile(times[name], 95):.2f}</td>"
            f"<td align='right'>{100 * ms / total:.0f} %</td></tr>"
            for name, ms in sorted(medians.items(), key=lambda item: -item[1])
        )
        head = (
            "<tr style='opacity:.55'><td>pass</td><td>median ms</td><td>p95</td><td>share</td></tr>"
        )
        style = "width:100%;font-size:.8em;padding:.4em"
        return f"<table class='profile' style='{style}'>{head}{rows}</table>"


def _series(label: str, color: str) -> dict[str, object]:
    return {"label": label, "stroke": color, "width": 1.5, "points": {"show": False}}
