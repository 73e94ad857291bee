"""The memory of surfaces that a static camera's video has shown behind moving things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.settings.trace import TraceSettings
from iprt.world.real.panorama import Panorama
from tests.kernels.tracing import panorama_of
from tests.oracles.remember import Memory, remembered
from tests.oracles.worlds import Box, Solid, Sphere, World
from tests.worlds import bright_walls, room_frame

OPENING, HIDDEN = 16, 64
WIDTH, HEIGHT = 128, 64
AWAY, NEAR = Sphere((-1.0, 0.2, 1.4), 0.4), Sphere((0.6, -0.3, -1.3), 0.4)
TRACE = TraceSettings()


def shown(*solids: Solid, width: int = WIDTH, height: int = HEIGHT) -> Frame:
    return room_frame(World(solids=solids), width, height, bright_walls)


def read(device: ComputeDevice, panorama: Panorama) -> Memory:
    """Return the device's memory."""
    background = panorama.background
    assert background is not None
    marks = device.read(background.marks)
    around = device.read(background.around)
    return Memory(
        device.read(background.depth),
        facing(device.read(background.plane)),
        device.read(background.color),
        (marks & OPENING) != 0,
        np.abs(around),
        around < 0.0,
        (marks & HIDDEN) != 0,
        device.read(background.hidden_light),
    )


def facing(plane: NDArray[np.floating]) -> NDArray[np.floating]:
    """Unit normals of tangent planes g, which face the centre; 0 where there is none."""
    return -plane / np.maximum(np.linalg.norm(plane, axis=-1, keepdims=True), 1e-30)


def after(device: ComputeDevice, frames: Sequence[Frame]) -> Memory:
    return read(device, panorama_of(device, frames[-1], *frames[:-1]))


def noisy(frame: Frame, seed: int, sigma: float) -> Frame:
    rng = np.random.default_rng(seed)
    depth = frame.depth * (1.0 + sigma * rng.standard_normal(frame.depth.shape))
    return replace(frame, depth=depth.astype(np.float32))


def random_film(seed: int, count: int) -> list[Frame]:
    """Any depth, normal, color, window and sky at any texel; surfaces stay for a while."""
    rng = np.random.default_rng(seed)
    height, width = 24, 96
    frames, depth = [], rng.uniform(0.5, 5.0, (height, width))
    centre = -View(width, height, projection="equirect").directions()
    normal = rng.normal(size=(height, width, 3))
    for _ in range(count):
        new = rng.random((height, width)) < 0.3
        other = rng.uniform(0.5, 5.0, (height, width))
        other[rng.random((height, width)) < 0.1] = np.inf
        depth = np.where(new, other, depth * rng.uniform(0.96, 1.04, (height, width)))
        normal = np.where(new[..., None], rng.normal(size=(height, width, 3)), normal)
        unit = normal / np.linalg.norm(normal, axis=-1, keepdims=True) + 1.1 * centre
        unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
        window = (rng.random((height, width)) < 0.2) & np.isfinite(depth)
        frames.append(
            Frame(
                rng.random((height, width, 3), np.float32),
                depth.astype(np.float32),
                window,
                np.where(np.isfinite(depth)[..., None], unit, 0.0).astype(np.float32),
            )
        )
    return frames


def stilled(frame: Frame, count: int) -> list[Frame]:
    """Later frames with the same surfaces, whose colors change in the left half only."""
    rng = np.random.default_rng(5)
    later = []
    for _ in range(count):
        color = frame.color.copy()
        half = color[:, : frame.width // 2]
        half[:] = rng.random(half.shape)
        later.append(replace(frame, color=color))
    return later


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("still", [0, 3])
def test_equals_its_twin(device: ComputeDevice, seed: int, still: int) -> None:
    frames = random_film(seed, 9)
    frames += stilled(frames[-1], still)
    panorama = Panorama(device, frames[0].width, frames[0].height, background=TRACE)
    # The unit of length is each frame's own; here it is the same for all.
    for frame in frames:
        panorama.load(frame)
        panorama.median_depth = 2.0
        panorama.remember(forget=False)
    mine, twin = read(device, panorama), remembered(frames, 0.05, 0.05)
    # float32 may decide otherwise where depths differ by the margin exactly.
    same = (mine.hidden == twin.hidden) & (mine.mixed == twin.mixed)
    assert (~same).sum() <= 4
    assert 0.2 < twin.hidden.mean() < 0.9
    assert (mine.opening == twin.opening)[same].all()
    for mine_of, twin_of in (
        (mine.depth, twin.depth),
        (mine.normal, twin.normal),
        (mine.color, twin.color),
        (mine.around, twin.around),
        (mine.light, twin.light),
    ):
        np.testing.assert_allclose(mine_of[same], twin_of[same], rtol=2e-6, atol=1e-6)


def test_what_a_ball_hides_is_the_wall(device: ComputeDevice) -> None:
    before, now = shown(AWAY), shown(NEAR)
    memory = after(device, [before, now])
    wall = shown()
    hides = now.depth < wall.depth
    gap = wall.depth - now.depth > 0.2
    assert gap.sum() > 50
    assert memory.hidden[gap].all()
    assert not memory.hidden[~hides].any()
    np.testing.assert_allclose(memory.depth[gap], wall.depth[gap], rtol=1e-6)
    np.testing.assert_allclose(memory.normal[gap], wall.normal[gap], atol=1e-6)
    np.testing.assert_array_equal(memory.color[gap], wall.color[gap])
    # What stood before the rest at first is not remembered: the wall is farther.
    uncovered = before.depth < wall.depth
    assert uncovered.sum() > 50
    np.testing.assert_allclose(memory.depth[uncovered], wall.depth[uncovered], rtol=1e-6)


def test_noise_makes_no_layers(device: ComputeDevice) -> None:
    still = shown(NEAR)
    memory = after(device, [noisy(still, seed, 0.01) for seed in range(12)])
    last = noisy(still, 11, 0.01)
    edge = np.abs(still.depth - np.roll(still.depth, 1, 1)) > 0.1
    assert not memory.hidden[~edge].any()
    np.testing.assert_allclose(memory.depth[~edge], last.depth[~edge], rtol=1e-6)


def test_what_nears_slowly_does_not_draw_the_wall_along(device: ComputeDevice) -> None:
    """A panel that leaves the wall by a centimetre a frame."""
    first = shown()
    frames = [
        shown(Box((0.0, 0.0, -2.5 + 0.01 * step), (1.0, 0.8, 0.005))) for step in range(1, 41)
    ]
    memory = after(device, [first, *frames])
    inside = first.depth - frames[-1].depth > 0.3
    assert inside.sum() > 100
    assert memory.hidden[inside].all()
    assert np.abs(memory.depth - first.depth)[inside].max() < 0.05 * first.depth.max() + 1e-3


def test_mixed_colors_at_rims_are_not_remembered(device: ComputeDevice) -> None:
    """Frames blurred by a texel, as lenses and codecs do; the ball comes, and goes."""

    def blurred(frame: Frame) -> Frame:
        color = sum(
            np.roll(frame.color, (dy, dx), (0, 1)) for dy in (-1, 0, 1) for dx in (-1, 0, 1)
        )
        return replace(frame, color=(np.asarray(color) / 9.0).astype(np.float32))

    def scene(*solids: Solid) -> Frame:
        frame = shown(*solids)
        red = np.where((frame.depth < shown().depth)[..., None], [9.0, 0.0, 0.0], [0.0, 1.0, 1.0])
        return blurred(replace(frame, color=red.astype(np.float32)))

    film = [scene(Sphere(tuple(place), 0.4)) for place in np.linspace(AWAY.centre, NEAR.centre, 8)]
    memory = after(device, film)
    assert memory.hidden.any()
    # The ball's red is seen only where it still is, and beside it.
    far = np.abs(np.linalg.norm(film[-1].color - [0.0, 1.0, 1.0], axis=-1)) < 1e-5
    clean = memory.hidden | far
    assert memory.color[clean][:, 0].max() < 1e-5


def test_is_forgotten(device: ComputeDevice) -> None:
    panorama = panorama_of(device, shown(NEAR), shown(AWAY))
    assert read(device, panorama).hidden.any()
    panorama.load(shown(NEAR))
    panorama.remember(forget=True)
    assert panorama.hidden_light is None
    assert not read(device, panorama).hidden.any()
    # And is built up anew.
    for solid in (AWAY, NEAR):
        panorama.load(shown(solid))
        panorama.remember(forget=False)
    assert read(device, panorama).hidden.any()


def layers(device: ComputeDevice, panorama: Panorama) -> NDArray[np.float32]:
    background = panorama.background
    assert background is not None
    return np.concatenate(
        [
            device.read(panorama.surface) - device.read(background.surface),
            (device.read(background.marks) & HIDDEN)[..., None].astype(np.float32),
        ],
        axis=-1,
    )


def test_where_nothing_is_hidden_both_layers_are_one(device: ComputeDevice) -> None:
    """To the last bit: planes, joints, ranges and their pyramid."""
    frame = shown(NEAR)
    panorama = panorama_of(device, frame, frame)
    background = panorama.background
    assert background is not None
    for mine, first in ((background.surface, panorama.surface), (background.range, panorama.range)):
        np.testing.assert_array_equal(device.read(mine), device.read(first))
    # Nor do they differ beside what is hidden, but in what is joined.
    panorama = panorama_of(device, frame, shown(AWAY))
    apart = layers(device, panorama)
    plain = apart[..., 4] == 0.0
    assert not apart[plain][:, :3].any()
    assert apart[plain][:, 3].any()


def turned(frame: Frame, columns: int) -> Frame:
    """The frame with the world turned by some columns."""
    turn = View(1, 1, 360.0 * columns / frame.width).world_from_view
    assert frame.normal is not None
    return replace(
        frame,
        color=np.roll(frame.color, columns, 1),
        depth=np.roll(frame.depth, columns, 1),
        opening=np.roll(frame.opening, columns, 1),
        normal=(np.roll(frame.normal, columns, 1) @ turn.T).astype(np.float32),
    )


def planes_and_ranges(
    device: ComputeDevice, panorama: Panorama, *, behind: bool
) -> NDArray[np.float32]:
    """(H, W, 6): planes, flags and ranges of the frame, or of the background."""
    layer = panorama.background if behind else panorama
    assert layer is not None
    texels = panorama.width * panorama.height
    range_ = device.read(layer.range)[:texels].reshape(panorama.height, panorama.width, 2)
    return np.concatenate([device.read(layer.surface), range_], axis=-1)


def test_what_is_hidden_is_joined_as_when_it_was_seen(device: ComputeDevice) -> None:
    """Planes and ranges stay, except at the rim; beside the seam as elsewhere."""
    empty, now = shown(), shown(NEAR)
    hidden = after(device, [empty, now]).hidden
    last = int(np.flatnonzero(hidden.any(0))[-1])
    # What is hidden ends with the last column, and what is beside it begins with the first one.
    frames = [turned(frame, WIDTH - 1 - last) for frame in (empty, now)]
    panorama = panorama_of(device, frames[1], frames[0])
    hidden = read(device, panorama).hidden
    assert hidden[:, -1].any()
    assert not hidden[:, 0].any()
    made = planes_and_ranges(device, panorama, behind=True)
    seen = planes_and_ranges(device, panorama_of(device, frames[0]), behind=False)
    inner = hidden & np.roll(hidden, 1, 0) & np.roll(hidden, -1, 0)
    inner &= np.roll(hidden, 1, 1) & np.roll(hidden, -1, 1)
    assert inner.sum() > 50
    for part in ([0, 1, 2], [4, 5]):
        np.testing.assert_allclose(made[inner][:, part], seen[inner][:, part], rtol=1e-5)
    joints = made[..., 3].astype(int) & 15
    np.testing.assert_array_equal(joints[inner], seen[..., 3].astype(int)[inner])
    # Neighbours agree about being joined.
    east, west, north, south = (joints & flag for flag in (1, 2, 4, 8))
    np.testing.assert_array_equal(east > 0, np.roll(west, -1, 1) > 0)
    np.testing.assert_array_equal(south[:-1] > 0, north[1:] > 0)
