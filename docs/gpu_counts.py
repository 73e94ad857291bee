"""Counts of the work of kernels in a frame: launches, work items, buffers, rays, their steps.

For `docs/gpu.py`. Kernels are built as for a device that is no CPU, whatever plays them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar
from unittest import mock

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.counting import CountingDevice
from iprt.device.kernel import Kernel
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.gbuffer.tiles import TILE
from iprt.measure.camera_motion import Turn, turned
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from tests.like_gpu import LikeGpu

ROOT = Path(__file__).resolve().parents[1]
VIDEO, FRAME = "video", "frame"
"""Kinds of frame: preparing a frame of a video, and a frame of a head that turns."""

BANDED = frozenset(("picture", "surfaces"))
"""Passes that go through a panorama in bands: `iprt.world.real.surfaces`."""
NO_EDGE = -1
SHARPENING = frozenset(("sharpen_edges", "sharpen_glossy"))
"""Kernels that work on pixels at edges alone, which `other_pixel` of `RealLayer` marks."""
FILL = "fill"
"""Name for clearing a buffer in tables of kernels."""

Key = tuple[str, str]
"""Pass and kernel."""
Mark = Callable[[tuple[str, ...]], None]
Seen = TypeVar("Seen")


@dataclass(frozen=True)
class Size:
    """Size of a run.

    Attributes
    ----------
    view, rows : int
        Pixels a side of the view, and rows of the panorama.
    warm_up : int
        Frames before the one that counts.
    settings : dict
        Settings that differ from the defaults.
    """

    view: int
    rows: int
    warm_up: int
    settings: dict[str, Any]


GBUFFER = {"gbuffer": "cl"}
FULL = Size(1024, 2048, 16, GBUFFER)
SMALL = Size(
    32,
    32,
    2,
    {**GBUFFER, "irradiance": {"rows": 16, "rays": 1}, "iprt": {"ratio_rows": 16}},
)


@dataclass
class Count:
    """Work of all launches of a kernel in a pass.

    Attributes
    ----------
    program : str
        File and defines.
    launches, items : int
        Items of lists of tiles, where a kernel works on these.
    bound : int
        Bytes of the bound buffers, each once per launch; where a pass works in bands, buffers that
        hold more than a band count once.
    active, rays, steps : int
        Where rays are traced: work items that trace, rays, and the steps of their marches.
    edges : int
        Pixels that `SHARPENING` kernels work on; they leave the others as they are.
    loaded, stored : int
        Bytes that instructions load from and store to global memory.
    flops, instructions : float
        Floating point operations, and instructions as a GPU issues them.
    """

    program: str = ""
    launches: int = 0
    items: int = 0
    bound: int = 0
    active: int = 0
    rays: int = 0
    steps: int = 0
    edges: int = 0
    loaded: int = 0
    stored: int = 0
    flops: float = 0.0
    instructions: float = 0.0

    @property
    def requested(self) -> int:
        """Bytes that instructions move."""
        return self.loaded + self.stored

    @property
    def amount(self) -> int:
        """Steps of rays, edges or work items, in proportion to which a launch's cost grows."""
        return self.steps or self.edges or self.items

    def scaled(self, small: Count) -> Count:
        """Return the count with the costs of a smaller run in proportion."""
        if not self.program:
            return self
        ratio = self.amount / max(small.amount, 1)
        return replace(
            self,
            loaded=round(small.loaded * ratio),
            stored=round(small.stored * ratio),
            flops=small.flops * ratio,
            instructions=small.instructions * ratio,
        )


Counts = dict[Key, Count]


class CountingGpu(LikeGpu, CountingDevice):
    """Counting device that builds the kernels of a device that is no CPU."""


# Playing ------------------------------------------------------------------------------------


def play(device: ComputeDevice, size: Size, mark: Mark = lambda _: None) -> dict[str, Counts]:
    """Count `VIDEO` and `FRAME`, without instructions.

    `mark` is called with the kind of frame, pass and kernel before each launch, which is
    done before the next one; and with nothing before launches that do not count.
    """
    counting = CountingGpu(device)

    @contextmanager
    def watch(what: str) -> Iterator[Counts]:
        with recorded(counting, lambda key: mark((what, *key))) as counts:
            yield counts
        mark(())

    return playing(counting, size, watch)


def playing(
    device: ComputeDevice,
    size: Size,
    watch: Callable[[str], AbstractContextManager[Seen]],
    count: int = 1,
) -> dict[str, Seen]:
    """Play `VIDEO` and `FRAME`, `count` times in a row each; return the values from `watch`."""
    scene = Scene.open(ROOT / "scenes360" / "room")
    frame = resized(scene.frame(), size.rows)
    view = replace(next(iter(scene.views.values())).view, width=size.view, height=size.view)
    settings = Settings.model_validate(size.settings)
    footage = Footage.of(frame, video=True, static_camera=True)
    found = {}
    given = (device, frame, scene.instances, view, settings)
    with Renderer(*given, footage=footage) as renderer, watch(VIDEO) as found[VIDEO]:
        for _ in range(count):
            renderer.load(replace(frame))
            renderer.real_world.prepare()
    reel = Turn(frame, scene.instances, view, settings)
    with reel.renderer(device) as renderer:
        for index in range(size.warm_up):
            renderer.look(turned(view, index))
            renderer.step()
        with watch(FRAME) as found[FRAME]:
            for index in range(size.warm_up, size.warm_up + count):
                renderer.look(turned(view, index))
                renderer.step()
    return found


@contextmanager
def recorded(device: CountingDevice, mark: Mark) -> Iterator[Counts]:
    """Count the launches in the block; `mark` is called with pass and kernel before each."""
    counts: Counts = {}
    buffers: dict[Key, list[cla.Array]] = {}
    launch, fill = Kernel.__call__, ComputeDevice.fill_zero

    def clear(self: ComputeDevice, array: cla.Array) -> None:
        fill(self, array)
        if array is not device._counters:
            count = counts.setdefault((device.profile.current, FILL), Count())
            count.launches += 1
            count.bound += array.nbytes
            count.stored += array.nbytes

    def record(kernel: Kernel, size: tuple[int, ...], *groups: Any, **own: Any) -> None:
        key = (device.profile.current, kernel.name)
        mark(key)
        launch(kernel, size, *groups, **own)
        device.wait()
        program = kernel.program.replace(" -DCOUNT_WORK=1", "")
        count = counts.setdefault(key, Count(program))
        count.launches += 1
        count.items += _items(device, kernel, size)
        if kernel.name in SHARPENING:
            marks = device.read(kernel.buffers["layer_other_pixel"])
            count.edges += int((marks != NO_EDGE).sum())
        held = {id(array): array for array in kernel.buffers.values() if hasattr(array, "nbytes")}
        buffers.setdefault(key, []).extend(held.values())

    device.wait()
    device.work.clear()
    with (
        mock.patch.object(Kernel, "__call__", record),
        mock.patch.object(ComputeDevice, "fill_zero", clear),
    ):
        yield counts
    for key, arrays in buffers.items():
        band = counts[key].items if key[0] in BANDED else 0
        counts[key].bound = _bound(arrays, band)
    for key, work in device.work.items():
        counts[key].active = work.active
        counts[key].rays = work.real.count + work.objects.count
        counts[key].steps = work.real.steps + work.objects.steps


def _items(device: ComputeDevice, kernel: Kernel, size: tuple[int, ...]) -> int:
    """Return the work items of a launch; over lists of tiles, only the items of listed tiles."""
    if "tiles" not in kernel.buffers or size[0] != TILE:
        return math.prod(size)
    lists = device.read(kernel.buffers["tiles"])
    layers = [kernel._fixed[f"layer_{entry}"] for entry in range(size[2])]
    return size[0] * size[1] * int(sum(lists[layer, 0] for layer in layers)) // (lists.shape[1] - 1)


def _bound(arrays: list[cla.Array], whole: int) -> int:
    """Sum the bytes of the buffers of launches; ones of at least `whole` elements count once."""
    once = {id(array): array.nbytes for array in arrays if 0 < whole <= array.size}
    return sum(once.values()) + sum(array.nbytes for array in arrays if id(array) not in once)


def resized(frame: Frame, rows: int) -> Frame:
    """Resize a panorama to a number of rows: color and inverse depth blended, masks not."""
    with np.errstate(divide="ignore"):
        depth = 1.0 / _blended(1.0 / frame.depth, rows)
    return replace(
        frame,
        color=_blended(frame.color, rows),
        depth=depth.astype(np.float32),
        opening=_nearest(frame.opening, rows),
        gloss=None if frame.gloss is None else _nearest(frame.gloss, rows),
    )


def _places(count: int, old: int) -> NDArray[np.float64]:
    return (np.arange(count) + 0.5) * (old / count) - 0.5


def _nearest(image: NDArray[Any], rows: int) -> NDArray[Any]:
    y, x = (np.rint(_places(n, old)).astype(int) for n, old in _sizes(image, rows))
    return np.ascontiguousarray(image[y][:, x % image.shape[1]])


def _blended(image: NDArray[np.float32], rows: int) -> NDArray[np.float32]:
    for axis, (count, old) in enumerate(_sizes(image, rows)):
        places = _places(count, old).clip(0.0, old - 1.0)
        low = places.astype(int)
        shape = [-1 if i == axis else 1 for i in range(image.ndim)]
        share = (places - low).astype(np.float32).reshape(shape)
        high = np.minimum(low + 1, old - 1)
        image = image.take(low, axis) * (1.0 - share) + image.take(high, axis) * share
    return image


def _sizes(image: NDArray[Any], rows: int) -> list[tuple[int, int]]:
    return [(rows, image.shape[0]), (2 * rows, image.shape[1])]
