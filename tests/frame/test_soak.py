"""Long videos: memory stays where it is, nothing becomes NaN, the same seed shows the same."""

from __future__ import annotations

import ctypes
import gc
import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
import pyopencl.array as cla
import pytest

from iprt.device import profile
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.film import Film
from iprt.footage.video.stream import Ahead
from iprt.scene.scene import Scene
from tests.frame.moving import FRAMES as CLIP
from tests.frame.moving import write_moving
from tests.frame.whole_frame import METHODS, chosen
from tests.waiting import until

pytestmark = pytest.mark.gl

FRAMES, AGAIN = 192, 24
"""Frames of the tests' film, and of those that are played a second time."""
WARM_UP = 96
"""Frames until the interpreter, the driver and FFmpeg have the memory that they keep."""
EVERY = 2 * CLIP
"""Frames from one look at the memory to the next: what is decoded ahead is the same every time."""
SLOPE = 500.0
"""Bytes per frame by which memory in use may seem to grow: less than the smallest object for which
Python asks the allocator."""
SIZE = (48, 24)
SETTINGS: dict[str, Any] = {"trace": {"object_rays": 1}, "atrous": {"levels": 3}}
"""Few pixels and rays: it is not the accuracy that lasts or does not."""


class CountingDevice(ComputeDevice):
    """Counts the buffers that are allocated and the kernels that are asked for."""

    made = 0

    def empty(self, *args: Any, **kwargs: Any) -> cla.Array:
        self.made += 1
        return super().empty(*args, **kwargs)

    def zeros(self, *args: Any, **kwargs: Any) -> cla.Array:
        self.made += 1
        return super().zeros(*args, **kwargs)

    def kernel(self, *args: Any, **kwargs: Any) -> Kernel:
        self.made += 1
        return super().kernel(*args, **kwargs)


class Look(NamedTuple):
    """State of a film after some frames.

    Attributes
    ----------
    digest : str
        Digest of all pictures so far.
    used : int
        Bytes that are allocated and not freed, buffers of PoCL's devices among them.
    made : int
        Buffers and kernels made so far.
    """

    digest: str
    used: int
    made: int


class Mallinfo(ctypes.Structure):
    """State of glibc's allocator (`man mallinfo2`)."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    )


def in_use() -> int:
    """Bytes that are allocated and not freed."""
    try:
        ask = ctypes.CDLL("libc.so.6").mallinfo2
    except (OSError, AttributeError):
        pytest.skip("needs glibc 2.33, which tells what is allocated")
    ask.restype = Mallinfo
    told = ask()
    return int(told.uordblks + told.hblkhd)


def at_rest(stream: Ahead[Any]) -> bool:
    """Return whether the stream has decoded as far ahead as it may."""
    return all(made.done() for made in stream._made)


def play(scene: Scene, compute: ComputeDevice, frames: int) -> list[Look]:
    """Loop the clip for so many frames and look every `EVERY` frames; no picture holds NaN."""
    device = CountingDevice(compute.device)
    settings, ahead = chosen(METHODS[0], seed=5, **SETTINGS), scene.views["ahead"]
    looks, digest = list[Look](), hashlib.sha256()
    streams: list[Ahead[Any]] = []

    def stream(*args: Any, **kwargs: Any) -> Ahead[Any]:
        streams.append(Scene.stream(scene, *args, **kwargs))
        return streams[-1]

    with (
        mock.patch.object(scene, "stream", stream),
        Film(scene, device, settings, view=replace(ahead, view=ahead.view.resized(*SIZE))) as film,
    ):
        for number, (_, picture) in enumerate(film.frames([i % CLIP for i in range(frames)])):
            assert np.isfinite(picture.color).all(), number
            digest.update(picture.color)
            if number % EVERY == EVERY - 1:
                until(lambda: at_rest(streams[-1]))
                device.profile.resolve()  # events that wait to be read are many or few
                gc.collect()
                looks.append(Look(digest.hexdigest(), in_use(), device.made))
    return looks


@pytest.mark.thorough
def test_a_long_film_stays_as_it_began(
    device: ComputeDevice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory does not grow, buffers and kernels are made once, a second run has the same bits."""
    # The profile's sample of frames, 4 kB each, is to be full when the warm-up is over.
    monkeypatch.setattr(profile, "MOST_FRAMES", WARM_UP // 2)
    scene = write_moving(tmp_path / "clip")
    looks = play(scene, device, FRAMES)
    digests = [look.digest for look in looks]
    # What is forgotten in every frame is in every step; what the driver keeps because more was on
    # its way at once than ever before is in a few.
    steps = np.diff([look.used for look in looks[WARM_UP // EVERY :]])
    assert np.median(steps) / EVERY < SLOPE
    assert {look.made for look in looks} == {looks[0].made}
    again = play(scene, device, AGAIN)
    assert [look.digest for look in again] == digests[: AGAIN // EVERY]
    assert len(set(digests)) == FRAMES // EVERY
