"""A small window's viewport, and waiting for what it shows."""

from __future__ import annotations

import time
from collections.abc import Callable

from iprt.viewer.displayed_frame import DisplayedFrame
from iprt.viewer.engine import Engine
from iprt.viewer.ui_state import UiState
from iprt.viewer.viewport import Viewport
from tests.viewer.turns import VIEW
from tests.waiting import DEADLINE_S

LOOK = VIEW.resized(48, 32)


class Ui(UiState):
    """A window that only notes what it is to show."""

    def __init__(self, engine: Engine) -> None:
        super().__init__(engine)
        self.viewport = Viewport(engine, VIEW, frames=1)
        self.said: list[tuple[str, bool]] = []

    def say(self, text: str, *, bad: bool = False) -> None:
        self.said.append((text, bad))


def until(viewport: Viewport, ready: Callable[[DisplayedFrame], bool]) -> DisplayedFrame:
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        displayed = viewport.poll()
        if displayed is not None and ready(displayed):
            return displayed
        time.sleep(0.005)
    raise AssertionError("no such picture in time")


def at_rest(viewport: Viewport) -> DisplayedFrame:
    return until(viewport, lambda s: s.shown.refined and s.shown.request == viewport._wanted)
