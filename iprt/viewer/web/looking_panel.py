"""Snapshots, distribution and pinned pixels in the tab of the picture."""

from __future__ import annotations

from html import escape

import numpy as np

from iprt.viewer.distribution import BINS, Distribution
from iprt.viewer.looking import pinned
from iprt.viewer.picking import Readout
from iprt.viewer.web.browser_state import BrowserState

WIDTH, PLOT, BAR = 300, 48, 10
"""Width of the histogram, its height, and the color bar's, in pixels."""


def distribution_html(ui: BrowserState) -> str:
    """Return the histogram with its color bar, as SVG; empty without one, and during motion."""
    displayed = ui.displayed
    if displayed is None or not displayed.shown.refined or ui.distribution is None:
        return ""
    return f"<div class='distribution' style='margin:.4em .8em'>{_svg(ui.distribution)}</div>"


def _svg(found: Distribution) -> str:
    shares = np.sqrt(found.counts / max(found.counts.max(), 1))
    step, parts = WIDTH / BINS, []
    for number, (share, color) in enumerate(zip(shares, found.colors, strict=True)):
        x, high = number * step, PLOT * share
        rgb = ",".join(str(int(part)) for part in color)
        parts.append(
            f"<rect x='{x:.2f}' y='{PLOT - high:.1f}' width='{step:.2f}' height='{high:.1f}' "
            f"fill='#8a929c'/><rect x='{x:.2f}' y='{PLOT}' width='{step + 0.3:.2f}' "
            f"height='{BAR}' fill='rgb({rgb})'/>"
        )
    first, last = (escape(end) for end in found.ends)
    text = f"y='{PLOT + BAR + 11}' font-size='10' fill='#a0a8b0'"
    return (
        f"<svg viewBox='0 0 {WIDTH} {PLOT + BAR + 14}' width='100%'>{''.join(parts)}"
        f"<text x='0' {text}>{first}</text>"
        f"<text x='{WIDTH}' text-anchor='end' {text}>{last}</text></svg>"
    )


def pixels_html(ui: BrowserState) -> str:
    """Return a table of the last clicked pixel and the pinned ones."""
    rows = [] if ui.read is None else [_row("click", ui.read)]
    rows += [_row(str(number), values) for number, values in enumerate(pinned(ui), 1)]
    if not rows:
        return "<p style='font-size:.8em;margin:.4em .8em'>Click a pixel to read its values.</p>"
    return f"<div class='pixels' style='font-size:.75em;margin:.4em .8em'>{''.join(rows)}</div>"


def _row(name: str, values: Readout) -> str:
    words = "; ".join(f"{key} {value}" for key, value in values.rows())
    return f"<p style='margin:.3em 0'><b>{escape(name)}</b> {escape(words)}</p>"
