"""Timing of frame preparation: from a decoded video frame to a world ready to render."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from iprt.device.profile import PassTime
from iprt.footage.frame import Frame
from iprt.footage.prepare.reading import RawFrame
from iprt.footage.video.stream import Ahead
from iprt.geometry.camera import View
from iprt.measure.results import grid_of
from iprt.output.grid import Grid
from iprt.settings.features import Features
from iprt.world.real.real_world import RealWorld

if TYPE_CHECKING:
    from collections.abc import Callable

    from iprt.device.compute import ComputeDevice
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

HELD = 4
"""Number of decoded frames kept in memory and repeated."""
WARM_UP = 4
"""Frames before the timed ones. The first is timed separately."""
BRIGHTER, FARTHER = 0.01, 1e-4
"""Relative change of radiance and depth between the frames made from a still picture."""


@dataclass(frozen=True)
class PreparationTimes:
    """Preparation times of a video's frames, without decoding.

    Attributes
    ----------
    size : (int, int)
        Width and height of the panorama.
    first_ms : float
        Time from the first decoded frame until it can be rendered, with kernels compiled before.
    ms : float
        Mean time of the following frames, which are prepared while others are loaded.
    preparing_ms : float
        Time per frame of the preparing thread: holes, drift, clipped lights, medians.
    loading_ms : float
        Time per frame of the loading thread, which mostly waits for the device.
    passes : tuple of PassTime
        Device time per frame.
    """

    scene: str
    device: str
    size: tuple[int, int]
    frames: int
    first_ms: float
    ms: float
    preparing_ms: float
    loading_ms: float
    passes: tuple[PassTime, ...]


def preparation_grid(times: PreparationTimes) -> Grid:
    """Build a table of the times."""
    width, height = times.size
    rows = {
        "first frame": f"{times.first_ms:.0f}",
        "each further frame": f"{times.ms:.1f}",
        "  preparing it ahead": f"{times.preparing_ms:.1f}",
        "  loading it": f"{times.loading_ms:.1f}",
        **{f"    {one.name} (device)": f"{one.device_ms:.1f}" for one in times.passes},
    }
    return grid_of(
        f"{times.scene}, video of {width} x {height} on {times.device}",
        [{"frame": name, "ms": ms} for name, ms in rows.items()],
        f"{1e3 / times.ms:.1f} frames a second without decoding, over {times.frames} frames",
        "frames are prepared while others are loaded, so that times of parts do not add up",
    )


def time_preparation(
    device: ComputeDevice,
    scene: Scene,
    settings: Settings,
    *,
    frames: int,
    size: tuple[int, int] | None = None,
    progress: Callable[[int], None] | None = None,
) -> PreparationTimes:
    """Time `frames` frames of a scene's video, resized to `size` (width, height) if given."""
    held = _decoded(scene, size)
    height, width = held[0].depth.shape
    for _ in range(2):  # the first one compiles kernels
        start = time.perf_counter()
        world = _world(device, scene, scene.preparation()(held[0]), settings)
        device.wait()
        first_ms = (time.perf_counter() - start) * 1e3
    preparing: list[float] = []
    loading: list[float] = []
    count = WARM_UP + frames
    with Ahead(_timed(scene.preparation().frames(_repeated(held, count)), preparing), 2) as stream:
        for index, frame in enumerate(stream):
            begin = time.perf_counter()
            world.load(frame)
            device.wait()
            end = time.perf_counter()
            loading.append(end - begin)
            if index + 1 == WARM_UP:
                device.profile.reset()
                start = end
            if progress is not None:
                progress(index + 1)
    return PreparationTimes(
        scene=scene.name,
        device=device.name,
        size=(width, height),
        frames=frames,
        first_ms=first_ms,
        ms=(end - start) / frames * 1e3,
        preparing_ms=fmean(preparing[WARM_UP:]) * 1e3,
        loading_ms=fmean(loading[WARM_UP:]) * 1e3,
        passes=tuple(
            replace(one, device_ms=one.device_ms / frames, host_ms=one.host_ms / frames)
            for one in device.profile.passes()
        ),
    )


def _world(device: ComputeDevice, scene: Scene, frame: Frame, settings: Settings) -> RealWorld:
    from iprt.film import footage_of

    materials = [m for instance in scene.instances for m in instance.mesh.materials]
    view = next((one.view for one in scene.views.values()), View(512, 512))
    footage = replace(
        footage_of(scene, frame, settings), video=True, static_camera=frame.pose is None
    )
    return RealWorld(device, frame, Features.of(materials, view, settings, footage))


def _decoded(scene: Scene, size: tuple[int, int] | None) -> list[RawFrame]:
    """Read the first `HELD` frames; make missing ones from the first with small changes."""
    indices = scene.frame_indices[:HELD]
    raws = [_enlarged(scene.raw_frame(index), size) for index in indices]
    for index in range(len(raws), HELD):
        still = raws[0]
        brighter = still.color * np.float32(1.0 + BRIGHTER * index)
        farther = still.depth * np.float32(1.0 + FARTHER * index)
        raws.append(replace(still, color=brighter, depth=farther))
    return raws


def _enlarged(raw: RawFrame, size: tuple[int, int] | None) -> RawFrame:
    """Resize a frame to (width, height) by nearest-neighbour sampling."""
    if size is None:
        return raw
    height, width = raw.depth.shape
    at = np.ix_(np.arange(size[1]) * height // size[1], np.arange(size[0]) * width // size[0])

    def chosen(picture: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.ascontiguousarray(picture[at])

    normal = None if raw.normal is None else chosen(raw.normal)
    return replace(raw, color=chosen(raw.color), depth=chosen(raw.depth), normal=normal)


def _repeated(raws: Sequence[RawFrame], count: int) -> Iterator[RawFrame]:
    for index in range(count):
        yield replace(raws[index % len(raws)], index=index)


def _timed(frames: Iterator[Frame], times: list[float]) -> Iterator[Frame]:
    while True:
        start = time.perf_counter()
        frame = next(frames, None)
        if frame is None:
            return
        times.append(time.perf_counter() - start)
        yield frame
