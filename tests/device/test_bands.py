"""Launches in parts: the same bits, fewer items at a time, and an end between two of them."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
import pytest

from iprt.device.bands import Bands
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.program import PlannedKernel
from iprt.geometry.camera import View
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from tests.clips import write_clip
from tests.viewer.turns import SETTINGS


class Event:
    """The event of a launch that took so many seconds."""

    def __init__(self, seconds: float) -> None:
        self._end = round(1e9 * seconds)

    def get_profiling_info(self, what: int) -> int:
        from pyopencl import profiling_info

        return self._end if what == profiling_info.END else 0


class Slow:
    """A device whose items take a millisecond each, by a clock of its own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        self.parts: list[tuple[int, int]] = []
        self.looks = 0
        monkeypatch.setattr("iprt.device.bands.time.perf_counter", lambda: self.now)
        self.bands = Bands(lambda: None, self.look)

    def look(self) -> None:
        self.looks += 1

    def enqueue(self, offset: tuple[int, ...], size: tuple[int, ...]) -> Event:
        self.parts.append((offset[-1], size[-1]))
        self.now += 1e-3 * np.prod(size)
        return Event(1e-3 * np.prod(size))


def test_parts_cover_all_items_once_and_none_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = Slow(monkeypatch)
    for rows in (1, 3, 16, 777, 1000):
        slow.parts.clear()
        slow.bands.launch(("program", "kernel"), (rows,), (1,), slow.enqueue)
        ends = [0, *(begin + size for begin, size in slow.parts)]
        assert [begin for begin, _ in slow.parts] == ends[:-1]
        assert ends[-1] == rows
        assert max(size for _, size in slow.parts) <= max(50, rows // 16)
        assert rows < 5 or slow.looks > len(slow.parts)
        slow.looks = 0


def test_rows_of_a_picture_are_not_split(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their work groups tell the column by their number."""
    slow = Slow(monkeypatch)
    slow.bands.launch(("program", "kernel"), (6400, 3), (64, 1), slow.enqueue)
    assert slow.parts == [(0, 1), (1, 1), (2, 1)]


def test_what_is_quick_is_launched_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once that is known; and after enough of it there is a look all the same."""
    slow = Slow(monkeypatch)
    slow.bands.launch(("program", "kernel"), (4, 64), (4, 1), slow.enqueue)
    slow.parts.clear()
    slow.looks = 0
    for _ in range(30):
        slow.bands.launch(("program", "kernel"), (2, 2), (1, 1), slow.enqueue)
    assert slow.parts == [(0, 2)] * 30
    assert 1 <= slow.looks <= 3


def test_work_ends_between_two_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = Slow(monkeypatch)

    def stop() -> None:
        if slow.parts:
            raise KeyError

    bands = Bands(lambda: None, stop)
    with pytest.raises(KeyError):
        bands.launch(("program", "kernel"), (1000,), (1,), slow.enqueue)
    assert sum(size for _, size in slow.parts) <= 1000 // 16


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return Scene.open(write_clip(tmp_path / "clip", 1))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("width", "height", "band_s", "least"), [(40, 24, 0.0, 500), (128, 128, 1e3, 200)]
)
def test_a_picture_in_parts_has_the_same_bits(
    scene: Scene,
    device: ComputeDevice,
    monkeypatch: pytest.MonkeyPatch,
    width: int,
    height: int,
    band_s: float,
    least: int,
) -> None:
    """Every kernel in as many parts as there are, and in parts that grow to most of the tiles."""
    view = View(width, height, pitch_deg=-35.0)
    launched: list[tuple[int, ...]] = []
    monkeypatch.setattr("iprt.device.bands.QUICK_S", -1.0)
    monkeypatch.setattr("iprt.device.bands.BAND_S", band_s)
    own = ComputeDevice(device.device)
    with Renderer(own, scene.frame(), scene.instances, view, SETTINGS) as renderer:
        whole = renderer.render(2, ["depth", "variance"])
    own.bands = Bands(own.wait, lambda: launched.append(()))
    with Renderer(own, scene.frame(), scene.instances, view, SETTINGS) as renderer:
        parts = renderer.render(2, ["depth", "variance"])
    assert len(launched) > least
    np.testing.assert_array_equal(parts.color, whole.color)
    for name in whole.aovs:
        np.testing.assert_array_equal(parts.aovs[name], whole.aovs[name])


SCALE = "__kernel void scale(__global float *it) { it[get_global_id(0)] *= BY; }"


def test_programs_that_are_not_in_use_are_forgotten(device: ComputeDevice, tmp_path: Path) -> None:
    """Those in use stay, however many; what is forgotten can be built again, and counts as new."""
    own = ComputeDevice(device.device)
    own.most_programs = 3
    variants = [{"BY": number} for number in range(6)]
    source, name = str(tmp_path / "scale.cl"), "scale"
    Path(source).write_text(SCALE)

    def planned(number: int) -> list[PlannedKernel]:
        return [PlannedKernel(source, name, variants[number])]

    def built(number: int) -> Kernel:
        kernel = own.kernel(source, name, variants[number])
        kernel.make()
        return kernel

    assert own.to_compile(planned(0)) == 2
    used = [built(number) for number in range(5)]
    assert len(own.built_programs) == 5
    assert own.to_compile(planned(0)) == 1, "it was not launched yet"
    del used[1:]
    gc.collect()
    last = built(5)
    assert len(own.built_programs) == 3
    assert [own.to_compile(planned(n)) for n in range(6)] == [1, 2, 2, 2, 1, 1]
    assert used
    assert last is not None
