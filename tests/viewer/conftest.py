from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from tests.clips import write_clip
from tests.viewer.turns import SETTINGS
from tests.viewer.viewports import Ui, at_rest
from tests.waiting import DEADLINE_S


@pytest.fixture(autouse=True)
def engines_end() -> Iterator[None]:
    """Engines that a test closed have ended before the next one uses the same device.

    `Engine.close` leaves a thread alone that still compiles after a few seconds.
    """
    before = set(threading.enumerate())
    yield
    for thread in set(threading.enumerate()) - before:
        if thread.name == "iprt viewer":
            thread.join(DEADLINE_S)


@pytest.fixture
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> Scene:
    """A clip of `CLIP_FRAMES` frames, a constant of the test's module, or of one frame."""
    return Scene.open(write_clip(tmp_path / "clip", getattr(request.module, "CLIP_FRAMES", 1)))


@pytest.fixture
def ui(scene: Scene, device: ComputeDevice) -> Iterator[Ui]:
    """A window on the clip with its cube selected."""
    with Engine(scene, lambda: device, SETTINGS) as engine:
        ui = Ui(engine)
        at_rest(ui.viewport)
        ui.selected = "cube"
        yield ui
        ui.viewport.close()
