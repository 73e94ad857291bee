"""Times of frames: sizes, motion, and presets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from statistics import median

import pytest

from iprt.commands.views import choose_view, moving_view
from iprt.device.compute import ComputeDevice
from iprt.measure.bench import timed, timed_together
from iprt.measure.camera_motion import Playback, Reel, Step, Turn
from iprt.measure.frame_preparation import time_preparation
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from iprt.settings.overrides import resolved
from iprt.settings.presets import PRESETS, Quality
from tests.on_device.frames import first_frame, opened

Size = tuple[int, int]
AROUND = (2048, 1024)
SIZES = ((512, 512), (1024, 1024), AROUND)
STILL, TURNING, VIDEO = "still", "turning", "next video frame"
PREPARED = ((2048, 1024), (4096, 2048))
FRAMES, FRAMES_OF_CPU = 30, 4
CASES = [
    (quality, size, motion)
    for quality, size, motion in product(
        sorted(PRESETS, key=lambda name: name != "balanced"), SIZES, (TURNING, STILL, VIDEO)
    )
    if (size, motion) != (AROUND, TURNING)  # it shows the same in all directions
]


@dataclass(frozen=True)
class Rest(Turn):
    """A view that stands still; its picture gets better."""

    @contextmanager
    def steps(self, device: ComputeDevice, count: int) -> Iterator[Iterator[Step]]:
        del device

        def stay(_: Renderer) -> None:
            pass

        yield (stay for _ in range(count))


def reel_of(size: Size, motion: str, settings: Settings) -> Reel:
    name = "equirect" if size == AROUND else None
    if motion == VIDEO:
        scene = opened("train")
        return Playback(scene, *moving_view(scene, name, size=size), settings)
    view, instances = choose_view(opened("room"), name, size=size)
    kind = Turn if motion == TURNING else Rest
    return kind(first_frame("room"), instances, view, settings)


@pytest.mark.parametrize("size", PREPARED, ids=str)
def test_preparing_a_video_frame(
    device: ComputeDevice, tell: Callable[..., None], size: Size
) -> None:
    device.profile.reset()
    frames = FRAMES_OF_CPU if device.is_cpu else FRAMES
    found = time_preparation(device, opened("train"), Settings(), frames=frames, size=size)
    passes = {entry.name: entry.device_ms for entry in found.passes}
    tell(ms=found.ms, preparing_ms=found.preparing_ms, first_ms=found.first_ms, passes=passes)


@pytest.mark.parametrize(("quality", "size", "motion"), CASES, ids=str)
def test_a_frame(
    device: ComputeDevice, tell: Callable[..., None], quality: Quality, size: Size, motion: str
) -> None:
    """Tell the time by the clock while nothing is recorded, and while passes are."""
    frames = FRAMES_OF_CPU if device.is_cpu else FRAMES
    reel = reel_of(size, motion, resolved(quality))
    (walls,) = timed_together(device, [reel], lambda count: count >= frames)
    # Recording takes much host time beside the frames of a fast GPU.
    report, _ = timed(device, reel, scene="", frames=frames)
    assert report.wall is not None
    assert report.host is not None
    tell(
        ms=median(walls),
        recorded_ms=report.wall.ms,
        p95_ms=report.wall.p95_ms,
        passes_ms=report.frame.ms,
        host_ms=report.host.ms,
        waits=report.synchronisations,
        launches=report.launches,
        traced=report.traced,
        first_frame_ms=report.prepare_ms,
        compile_ms=report.compile_ms,
        bytes=sum(report.buffers.values()),
        passes={entry.name: entry.timing.ms for entry in report.passes},
    )
