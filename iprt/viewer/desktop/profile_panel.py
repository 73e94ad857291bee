"""The panel of times: what each pass of the last view frames took."""

from __future__ import annotations

from iprt.viewer.desktop.desk import Desk


def draw(desk: Desk) -> None:
    """The whole panel."""
