"""The sparse tracing mask against its twin and its promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyopencl.array as cla
import pytest

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import LEVEL_NONE, STRONG_FRAMES, Mask, Masks, grid_offset
from iprt.gbuffer.layout import PlaneLayout
from iprt.settings.features import TOUCHED_FRAMES
from iprt.settings.filter import MaskSettings
from tests.filter.gbuffer import (
    SIZES,
    GBuffer,
    flat_gbuffer,
    random_gbuffer,
    read,
    still_motion,
    tracing_grid,
    upload,
)
from tests.oracles import mask as oracle


def still(device: ComputeDevice, layout: PlaneLayout) -> cla.Array:
    return upload(device, layout, still_motion(layout.width, layout.height))


def certain(device: ComputeDevice, layout: PlaneLayout, history: np.ndarray) -> cla.Array:
    """Certainties of a mean of so many samples."""
    return upload(device, layout, np.stack([np.zeros_like(history), history]))


def run(
    device: ComputeDevice,
    gbuffer: GBuffer,
    offset: tuple[int, int],
    touched: np.ndarray,
    sigma: float = 0.1,
    graded: bool = False,
    history: np.ndarray | None = None,
) -> tuple[Mask, np.ndarray, np.ndarray]:
    """Mask, (H, W) level, and (H, W) bool of the listed pixels."""
    layout = gbuffer.layout
    settings = MaskSettings(sigma_position=sigma)
    mask = Mask(device, gbuffer.guide(device, pictures=2), settings, name="test", graded=graded)
    device.write(mask.touched, layout.padded(touched[None]))
    histories = None if history is None else [certain(device, layout, history)]
    Masks(device, [mask]).run(tracing_grid(device, offset), [still(device, layout)], histories)
    count = int(device.read(mask.count)[0])
    listed = np.bincount(device.read(mask.traced)[:count], minlength=layout.width * layout.height)
    assert listed.max(initial=0) <= 1
    level = read(device, layout, mask.level)[0]
    return mask, level, listed.reshape(layout.height, layout.width) > 0


@pytest.mark.parametrize("known", [False, True], ids=["no history", "history"])
@pytest.mark.parametrize("graded", [False, True], ids=["all alike", "graded"])
@pytest.mark.parametrize("equirect", [False, True])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_equals_twin(
    device: ComputeDevice, width: int, height: int, equirect: bool, graded: bool, known: bool
) -> None:
    gbuffer = random_gbuffer(width, height, equirect=equirect)
    rng = np.random.default_rng(1)
    touched = (rng.random((height, width)) < 0.01) * rng.choice(
        [1.0, 4.0, 11.0, 12.0], (height, width)
    )
    sigma = 0.7 if equirect else 2.0
    history = rng.choice([0.0, 7.0, 8.0, 300.0], (height, width)) if known else None
    mask, level, listed = run(device, gbuffer, (1, 2), touched, sigma, graded, history)
    carried = read(device, gbuffer.layout, mask.touched)[0]
    touched = np.maximum(touched - 1.0, 0.0)
    assert np.array_equal(carried, np.where(gbuffer.seen_ids > 0.0, touched, 0.0))
    touched = carried
    weight = oracle.tracing_weight(
        gbuffer.normal, gbuffer.position, gbuffer.seen_ids, touched, sigma, equirect,
        TOUCHED_FRAMES - 1.0 if graded else 0.0,
    )  # fmt: skip
    low, high = (0.3, 0.5) if min(width, height) >= 4 else (0.0, 0.0)
    near = oracle.near(touched, equirect)
    if graded:  # edges are worth rays only where objects change something
        weight = np.where(near, weight, 0.0)
    clear = np.minimum(abs(weight - low), abs(weight - high)) > 1e-4
    expected = oracle.levels(weight, gbuffer.seen_ids, low, high, near)
    if history is not None:
        expected = oracle.waiting(expected, history, (1, 2))
    assert np.array_equal(level[clear], expected[clear])
    assert np.array_equal(listed, oracle.traced(level, (1, 2)))
    if width == 64:
        assert set(np.unique(level)) == {0, 1, 2, LEVEL_NONE} | ({3} if known else set())


def test_faint_influence_takes_a_quarter_of_the_rays(device: ComputeDevice) -> None:
    """For as long as it is remembered, and after a strong one has faded."""
    gbuffer = flat_gbuffer(32, 24)
    touched = np.zeros((24, 32))
    touched[10, 16], touched[10, 4] = STRONG_FRAMES, TOUCHED_FRAMES
    mask, level, _ = run(device, gbuffer, (0, 0), touched, graded=True)
    seen = []
    for _ in range(22):
        seen.append([int((level == number).sum()) for number in (0, 1)])
        Masks(device, [mask]).run(tracing_grid(device, (0, 0)), [still(device, gbuffer.layout)])
        level = read(device, gbuffer.layout, mask.level)[0]
    assert seen == [[9, 9]] * 10 + [[0, 9]] * 10 + [[0, 0]] * 2


def test_each_pixel_gets_a_ray_where_nothing_is_known(device: ComputeDevice) -> None:
    """The first picture, the first after a cut, and surfaces that come into view, once each."""
    wall = flat_gbuffer(32, 24)
    box, uncovered = wall.depth.copy(), np.zeros((24, 32), bool)
    uncovered[:, 20:24] = True
    box[uncovered] *= 0.8
    hidden = replace(wall, depth=box)
    settings = MaskSettings(sigma_position=0.1)
    mask = Mask(device, hidden.guide(device), settings, name="test", graded=True)
    masks = Masks(device, [mask])

    def step(shown: GBuffer | None = None, *, cut: bool = False) -> np.ndarray:
        if shown is not None:
            shown.fill(device, mask.guide)
        masks.run(tracing_grid(device, (0, 0)), [still(device, wall.layout)], cut=cut)
        return read(device, wall.layout, mask.level)[0]

    assert (step() == 0).all()
    assert (step(hidden) == 2).all()
    assert np.array_equal(step(wall), np.where(uncovered, 0, 2))
    assert (step(wall) == 2).all()
    assert (step(wall, cut=True) == 0).all()
    assert (step(wall) == 2).all()


def test_influence_moves_with_the_picture(device: ComputeDevice) -> None:
    gbuffer = flat_gbuffer(32, 24)
    touched = np.zeros((24, 32))
    touched[10, 16] = touched[4, 0] = TOUCHED_FRAMES
    mask, _, _ = run(device, gbuffer, (0, 0), touched)
    motion = np.full((2, 24, 32), -1e9)
    motion[:, 12, 20] = 16.4, 10.6
    motion[:, 4, 3] = -0.4, 4.5  # from beside the picture
    Masks(device, [mask]).run(
        tracing_grid(device, (0, 0)), [upload(device, gbuffer.layout, motion)]
    )
    level = read(device, gbuffer.layout, mask.level)[0]
    expected = np.full((24, 32), 2)
    expected[11:14, 19:22] = 0
    assert np.array_equal(level, expected)


def test_flat_wall_takes_a_sixteenth_of_the_rays(device: ComputeDevice) -> None:
    _, _, listed = run(device, flat_gbuffer(64, 48), (3, 1), np.zeros((48, 64)))
    assert listed.sum() == 64 * 48 // 16


def test_grid_visits_every_pixel_within_sixteen_frames() -> None:
    offsets = [grid_offset(frame) for frame in range(16)]
    assert len(set(offsets)) == 16
    assert {(x % 2, y % 2) for x, y in offsets[:4]} == {(0, 0)}
    assert len({(x // 2, y // 2) for x, y in offsets[:4]}) == 4
    assert grid_offset(16) == offsets[0]


def test_a_long_history_takes_a_quarter_of_the_rays_from_all_pixels(device: ComputeDevice) -> None:
    gbuffer = flat_gbuffer(32, 24)
    touched, history = np.full((24, 32), TOUCHED_FRAMES), np.full((24, 32), 8.0)
    rays = np.zeros((24, 32), int)
    for frame in range(16):
        _, _, listed = run(device, gbuffer, grid_offset(frame), touched, history=history)
        rays += listed
    assert (rays == 4).all()


def test_a_history_is_looked_up_where_the_surface_was(device: ComputeDevice) -> None:
    gbuffer = flat_gbuffer(32, 24)
    layout = gbuffer.layout
    mask = Mask(device, gbuffer.guide(device, pictures=2), MaskSettings(), name="test")
    device.write(mask.touched, np.full(mask.touched.shape, TOUCHED_FRAMES, np.float32))
    history = np.zeros((24, 32))
    history[10, 16] = 8.0
    motion = np.full((2, 24, 32), -1e9)
    motion[:, 12, 21] = 16.4, 10.6
    Masks(device, [mask]).run(
        tracing_grid(device, (0, 0)),
        [upload(device, layout, motion)],
        [certain(device, layout, history)],
    )
    level = read(device, layout, mask.level)[0]
    assert np.argwhere(level == 3).tolist() == [[12, 21]]


def test_dense_setting_traces_all(device: ComputeDevice) -> None:
    gbuffer = random_gbuffer(31, 17, equirect=False)
    mask = Mask(device, gbuffer.guide(device), MaskSettings(sparse=False), name="test")
    Masks(device, [mask]).run(tracing_grid(device, (1, 1)), [still(device, gbuffer.layout)])
    assert device.read(mask.count)[0] == (gbuffer.seen_ids > 0.0).sum()


def test_equirect_picture_turns_with_the_view(device: ComputeDevice) -> None:
    gbuffer = random_gbuffer(64, 32, equirect=True)
    touched = np.zeros((32, 64))
    touched[15, 63] = 5.0
    _, level, _ = run(device, gbuffer, (0, 0), touched)
    _, turned, _ = run(device, gbuffer.rolled(5), (0, 0), np.roll(touched, 5, 1))
    assert level[15, 0] in (0, LEVEL_NONE)
    assert (np.roll(level, 5, 1) != turned).mean() < 0.002  # rounding at the thresholds
