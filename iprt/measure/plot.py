"""Small SVG plots for `report.html`: points with error bars, and lines."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SVG = "http://www.w3.org/2000/svg"
STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "iprt",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "lines.linewidth": 1.5,
}


@dataclass(frozen=True)
class Mark:
    """A point with the half width of its confidence interval in y.

    Attributes
    ----------
    hint : str
        Tooltip.
    label : str
        Text beside the point.
    solid : bool
        Draw a filled point on the line of the series, else a ring off the line.
    """

    x: float
    y: float
    half: float = 0.0
    hint: str = ""
    label: str = ""
    solid: bool = True


@dataclass(frozen=True)
class Series:
    """Marks of one color. A polyline or, with `steps`, a step line joins the solid ones."""

    name: str
    marks: tuple[Mark, ...]
    steps: bool = False


@dataclass(frozen=True)
class Plot:
    """A plot with a logarithmic x axis (x > 0) and at least one mark."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    notes: tuple[str, ...] = ()

    @property
    def data(self) -> str:
        """The plot as an SVG file in a data URI. Equal plots give equal files."""
        import matplotlib

        ElementTree.register_namespace("", SVG)
        stream = io.StringIO()
        with matplotlib.rc_context(STYLE):
            self.figure().savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
        root = ElementTree.fromstring(stream.getvalue())
        for identity, mark in self._identities().items():
            drawn = root.find(f".//*[@id='{identity}']")
            if drawn is not None and mark.hint:
                title = ElementTree.Element(f"{{{SVG}}}title")
                title.text = mark.hint
                drawn.insert(0, title)
        return "data:image/svg+xml;base64," + base64.b64encode(ElementTree.tostring(root)).decode()

    def figure(self) -> Figure:
        """Draw the plot with matplotlib."""
        from matplotlib.figure import Figure
        from matplotlib.ticker import LogLocator, StrMethodFormatter

        figure = Figure((7.6, 4.2), layout="constrained")
        axes = figure.add_subplot(xscale="log", xlabel=self.x_label, ylabel=self.y_label)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.minorticks_off()
        identities = iter(self._identities())
        for number, series in enumerate(self.series):
            color = f"C{number}"
            line = sorted((mark.x, mark.y) for mark in series.marks if mark.solid)
            axes.plot(
                [x for x, _ in line],
                [y for _, y in line],
                color=color,
                drawstyle="steps-post" if series.steps else "default",
                label=series.name,
            )
            for mark in series.marks:
                axes.errorbar(mark.x, mark.y, mark.half or None, fmt="none", color=color)
                fill = color if mark.solid else "white"
                axes.plot(mark.x, mark.y, "o", color=color, mfc=fill, gid=next(identities))
                axes.annotate(
                    mark.label, (mark.x, mark.y), (6, 5), textcoords="offset points", fontsize=9
                )
        if any(series.name for series in self.series):
            axes.legend(loc="lower right")
        return figure

    def _identities(self) -> dict[str, Mark]:
        marks = [mark for series in self.series for mark in series.marks]
        return {f"mark-{number}": mark for number, mark in enumerate(marks)}
