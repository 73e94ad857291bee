"""Streams: frames in order, made ahead, few at a time, and never left behind."""

from __future__ import annotations

import gc
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from iprt.errors import FormatError, SceneError
from iprt.footage.frame import Frame
from iprt.footage.prepare.reading import RawFrame
from iprt.footage.prepare.stages import Preparation
from iprt.footage.video.stream import Ahead
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, write_channels, write_rgb, write_scene
from tests.waiting import DEADLINE_S, until


def write_video(folder: Path, frames: int, width: int = 8) -> Path:
    """Frames 1 to `frames`, of color and depth equal to their numbers."""
    manifest = MANIFEST.replace("color.exr", "c.%03d.exr").replace("depth.exr", "d.%03d.exr")
    write_scene(folder, manifest + f"frames = [1, {frames}]\n", width)
    for index in range(1, frames + 1):
        plane = np.full((width // 2, width), index, np.float32)
        write_rgb(folder / f"c.{index:03}.exr", np.repeat(plane[..., None], 3, axis=-1))
        write_channels(folder / f"d.{index:03}.exr", Z=plane)
    return folder


def threads() -> int:
    return sum(thread.name.startswith("iprt frames") for thread in threading.enumerate())


def test_frames_come_in_the_order_asked_for(tmp_path: Path) -> None:
    scene = Scene.open(write_video(tmp_path, 5))
    order = [3, 1, 1, 5, 4]
    with scene.stream(order) as frames:
        found = [(frame.index, frame.color[0, 0, 0], frame.depth[0, 0]) for frame in frames]
    assert found == [(index, index, index) for index in order]
    assert threads() == 0


def test_depth_that_does_not_change_is_sanitized_once(tmp_path: Path) -> None:
    """All but openings, which are told by color: a dropout that lights up becomes a window."""
    write_video(tmp_path, 6, 256)
    manifest = (tmp_path / "scene.toml").read_text().replace("d.%03d.exr", "depth.exr")
    # Gloss that nobody declared is looked for in a frame of its own.
    manifest = manifest.replace("[video]", '[video]\ngloss = "declared"')
    (tmp_path / "scene.toml").write_text(manifest)
    depth = np.full((128, 256), 3.0, np.float32)
    depth[2, 100] = 0.0
    write_channels(tmp_path / "depth.exr", Z=depth)
    light = np.ones((128, 256, 3), np.float32)
    light[2, 100] = 50.0
    write_rgb(tmp_path / "c.004.exr", light)
    scene = Scene.open(tmp_path)
    with scene.stream(scene.frame_indices) as stream:
        frames = list(stream)
    kept = [frame.depth is before.depth for before, frame in pairwise(frames)]
    assert kept == [True, True, False, False, True], "but for the one with a window"
    assert [bool(frame.opening[2, 100]) for frame in frames] == [False] * 3 + [True] + [False] * 2
    for frame in frames:
        alone = scene.frame(frame.index)
        for name in ("color", "depth", "opening", "fitted_normal"):
            assert np.array_equal(getattr(frame, name), getattr(alone, name))


def test_unknown_frames_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    scene = Scene.open(write_video(tmp_path, 2))
    with pytest.raises(SceneError, match="no frame 3; the scene has 1 to 2"):
        scene.stream([1, 2, 3])


def test_an_error_comes_where_its_frame_would_have(tmp_path: Path) -> None:
    scene = Scene.open(write_video(tmp_path, 4))
    (tmp_path / "c.003.exr").write_bytes(b"")
    seen = []
    with (
        pytest.raises(FormatError, match=r"c\.003\.exr: empty"),
        scene.stream(scene.frame_indices, strict=True) as frames,
    ):
        seen += [frame.index for frame in frames]
    assert seen == [] or seen == [1, 2]
    assert threads() == 0


def test_few_frames_are_alive_however_long_the_video(tmp_path: Path) -> None:
    scene = Scene.open(write_video(tmp_path, 4))
    references: list[weakref.ref[Frame]] = []
    most = 0

    class Counted(Preparation):
        def __call__(self, raw: RawFrame) -> Frame:
            frame = super().__call__(raw)
            references.append(weakref.ref(frame))
            return frame

    def alive() -> int:
        return sum(reference() is not None for reference in references)

    def counted(*, drift: bool = True, daylight: bool = True) -> Preparation:
        return Counted(drift=drift)

    scene.preparation = counted  # type: ignore[method-assign]
    ahead = 3
    with scene.stream([1, 2, 3, 4] * 75, ahead=ahead) as frames:
        for _ in frames:
            most = max(most, alive())
    del _
    gc.collect()
    assert len(references) == 300
    # Ready, in the making, at the consumer, and the last good one.
    assert most <= ahead + 3
    assert alive() == 0


def test_decoding_runs_ahead_and_no_further() -> None:
    made: list[int] = []

    def items() -> Iterator[int]:
        for number in range(100):
            made.append(number)
            yield number

    with Ahead(items(), ahead=2) as stream:
        iterator = iter(stream)
        assert next(iterator) == 0
        until(lambda: len(made) >= 4)
        time.sleep(0.1)
        assert len(made) == 4, "one taken, two ready, one that waits for room"
    assert threads() == 0


def test_a_consumer_that_leaves_early_ends_the_thread_and_closes_the_source() -> None:
    closed = threading.Event()

    def items() -> Iterator[int]:
        try:
            while True:
                yield 1
        finally:
            closed.set()

    with Ahead(items(), ahead=1) as stream:
        for _ in stream:
            break
    assert closed.is_set()
    assert threads() == 0
    assert list(stream) == []


def test_the_end_comes_again_to_who_asks_again() -> None:
    with Ahead([1, 2], ahead=1) as stream:
        assert list(stream) == [1, 2]
        assert list(stream) == []


def test_a_signal_ends_a_program_that_waits_for_a_frame() -> None:
    program = """
import os, signal, time
from iprt.files.termination import end_on_signals
from iprt.footage.video.stream import Ahead

def items():
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(1000.0)
    yield 1

end_on_signals()
with Ahead(items(), ahead=1) as stream:
    list(stream)
"""
    words = [sys.executable, "-c", program]
    done = subprocess.run(words, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stderr == "iprt: terminated by SIGTERM\n"
