"""Times of frames: sizes, what moves, and presets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from statistics import median
from typing import cast

from iprt.commands.views import choose_view, moving_view
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.measure.bench import timed, timed_together
from iprt.measure.camera_motion import Playback, Reel, Step, Turn
from iprt.measure.cost_report import CostReport
from iprt.measure.frame_preparation import time_preparation
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from iprt.settings.overrides import resolved
from iprt.settings.presets import PRESETS, Quality
from tests.on_device.cases import Asked, Cases, Row
from tests.on_device.frames import first_frame, opened

SQUARES = ((512, 512), (1024, 1024))
AROUND = (2048, 1024)
STILL, TURNING, VIDEO = "still", "turning", "next video frame"
INTAKE = ((2048, 1024), (4096, 2048))
FRAMES, FRAMES_OF_CPU = 30, 4


@dataclass(frozen=True)
class Rest(Turn):
    """Nothing moves, and the picture gets better."""

    @contextmanager
    def steps(self, device: ComputeDevice, count: int) -> Iterator[Iterator[Step]]:
        del device

        def stay(_: Renderer) -> None:
            pass

        yield (stay for _ in range(count))


def cases(asked: Asked) -> Cases:
    """Preset by preset, the default one first; and frames of videos as they come in."""
    device = ComputeDevice(choose_device(asked.device))
    frames = FRAMES_OF_CPU if device.is_cpu else FRAMES
    found: dict[str, Callable[[], list[Row]]] = {}
    for quality in sorted(PRESETS, key=lambda name: name != "balanced"):
        for size in (*SQUARES, AROUND):
            for motion in (TURNING, STILL, VIDEO):
                if size == AROUND and motion == TURNING:
                    continue  # it shows the same from wherever the head looks

                def measure(
                    quality: Quality = quality,
                    size: tuple[int, int] = size,
                    motion: str = motion,
                ) -> list[Row]:
                    reel = _reel(size, motion, resolved(quality))
                    return measured(device, reel, frames)

                found[f"{quality}, {size[0]}x{size[1]}, {motion}"] = measure
        if quality == "balanced":
            found |= {
                f"video frame of {size[0]}x{size[1]} comes in": (
                    lambda size=size: _intake(device, size, frames)
                )
                for size in INTAKE
            }
    return found


def measured(device: ComputeDevice, reel: Reel, frames: int) -> list[Row]:
    """A row; its first column is the time by the clock while nothing is recorded."""
    (walls,) = timed_together(device, [reel], lambda count: count >= frames)
    # Recording takes the host long beside the frames of a fast GPU.
    report, _ = timed(device, reel, scene="", frames=frames)
    return [{"ms": median(walls), **row(report)}]


def row(report: CostReport) -> Row:
    """Milliseconds of a frame while times are recorded, those of each pass with them."""
    assert report.wall is not None
    assert report.host is not None
    return {
        "recorded ms": report.wall.ms,
        "95% ms": report.wall.p95_ms,
        "passes ms": report.frame.ms,
        "host ms": report.host.ms,
        "waits": report.synchronisations,
        "launches": report.launches,
        "traced %": None if report.traced is None else 100.0 * report.traced,
        "first frame ms": report.prepare_ms,
        "compile ms": report.compile_ms,
        "MiB": sum(report.buffers.values()) >> 20,
        "passes": {entry.name: entry.timing.ms for entry in report.passes},
    }


def _reel(size: tuple[int, int], motion: str, settings: Settings) -> Reel:
    name = "equirect" if size == AROUND else None
    if motion == VIDEO:
        scene = opened("train")
        moving, objects = moving_view(scene, name, size=size)
        return Playback(scene, moving, objects, settings)
    scene = opened("room")
    view, instances = choose_view(scene, name, size=size)
    kind = Turn if motion == TURNING else Rest
    return cast(Reel, kind(first_frame("room"), instances, view, settings))


def _intake(device: ComputeDevice, size: tuple[int, int], frames: int) -> list[Row]:
    device.profile.reset()
    found = time_preparation(device, opened("train"), Settings(), frames=frames, size=size)
    return [
        {
            "ms": found.ms,
            "host ms": found.preparing_ms,
            "first frame ms": found.first_ms,
            "passes": {entry.name: entry.device_ms for entry in found.passes},
        }
    ]
