"""An engine's work without its thread: turn by turn, by a clock that the test sets."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.viewer.core import Core
from iprt.viewer.scene_files import POLL_S
from iprt.viewer.session import Shown
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import Playback, Request, World
from tests.films import FEW
from tests.waiting import DEADLINE_S

SETTINGS = Settings.model_validate(FEW)
FEWEST = SETTINGS.model_copy(update={"method": "ibl"})
"""Fewer kernels, for what does not depend on them."""
VIEW = View(32, 16, pitch_deg=-30.0)


class Clock:
    """Stands until the test sets it."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Turns:
    """A core and what drives it."""

    def __init__(self, scene: Scene, make: Callable[[], ComputeDevice], settings: Settings) -> None:
        self.clock = Clock()
        self.shared = SharedState(World(settings, Playback(scene.frame_indices[0])))
        self.core = Core(self.shared, scene, make, clock=self.clock)

    def join(self, **request: Any) -> int:
        return self.shared.join(Request(**{"view": VIEW, "frames": 1, **request}))

    def ask(self, client: int, **request: Any) -> int:
        return self.shared.ask(client, Request(**{"view": VIEW, "frames": 1, **request}))

    def change(self, **parts: Any) -> int:
        return self.shared.change(lambda world: replace(world, **parts))

    def shown(self, client: int) -> Shown:
        shown = self.shared.shown(client)
        assert shown is not None
        return shown

    def until(self, done: Callable[[], bool]) -> int:
        """Turns until something is so; how many of them did something."""
        count, end = 0, time.monotonic() + DEADLINE_S
        while not done():
            assert time.monotonic() < end, self.shared.status
            count += self.core.turn() or self._pause()
        return count

    def answer(self, client: int, number: int = 0) -> Shown:
        """The first picture that answers a number."""

        def answered() -> bool:
            shown = self.shared.shown(client)
            return shown is not None and shown.number >= number

        self.until(answered)
        return self.shown(client)

    @property
    def problems(self) -> tuple[str, ...]:
        return self.shared.status.problems

    def look_again(self) -> None:
        """It is time to look at the scene's files, and what is found there is read."""
        self.clock.now += POLL_S
        self.core.turn()
        self.settle()

    def settle(self) -> int:
        """Turns until nothing is left to do and nothing is on its way; how many rendered."""
        count = 0
        feed = self.core.video._feed
        while self.core.turn() or self.core.jobs.running or feed is None or not feed.arrived:
            feed = self.core.video._feed
            count += 1
        return count

    @staticmethod
    def _pause() -> int:
        time.sleep(0.002)  # other threads read and decode meanwhile
        return 0


@contextmanager
def turns(
    scene: Scene,
    device: ComputeDevice | Callable[[], ComputeDevice],
    settings: Settings = SETTINGS,
) -> Iterator[Turns]:
    make = device if not isinstance(device, ComputeDevice) else (lambda: device)
    driver = Turns(scene, make, settings)
    try:
        yield driver
    finally:
        driver.core.close()
        driver.core.jobs.close(time.monotonic() + DEADLINE_S)
