"""A viewer without windows, as programs control it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.program.control import Control
from iprt.viewer.ui_state import UiState
from iprt.viewer.windows import Start, Windows
from tests.viewer.turns import SETTINGS, VIEW

SIZE = (VIEW.width, VIEW.height)


class NoWindows(Windows):
    """Nobody has opened a window yet."""

    def __init__(self, start: Start) -> None:
        self._start, self.left = start, False

    @property
    def start(self) -> Start:
        return self._start

    def begin(self, start: Start) -> None:
        self._start = start

    @property
    def states(self) -> tuple[UiState, ...]:
        return ()

    def leave(self) -> None:
        self.left = True


@contextmanager
def controlled(scene: Scene, device: ComputeDevice) -> Iterator[tuple[Control, NoWindows]]:
    windows = NoWindows(Start(VIEW))
    with Engine(scene, lambda: device, SETTINGS) as engine:
        yield Control(engine, windows), windows
