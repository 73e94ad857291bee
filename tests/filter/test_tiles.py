"""Passes work on the tiles that show surfaces, with the same result."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant, float_constant
from iprt.filter.influence import Change, Influence, Probes
from iprt.filter.mask import Mask, Masks, tracing_grids
from iprt.filter.signal_filter import Samples, SignalFilter
from iprt.filter.signals import Kind, Signal, signal_planes
from iprt.gbuffer.guide import Guide, Guides, Layer
from iprt.gbuffer.layout import PAD
from iprt.gbuffer.tiles import PROBES, TILE, Tiles
from iprt.settings.model import Settings
from iprt.trace.relight import Relight
from tests.filter.gbuffer import (
    GBuffer,
    flat_gbuffer,
    random_gbuffer,
    read,
    still_frame,
    still_motion,
    upload,
)
from tests.trace.even_cache import WORLD, EvenCache

GUIDE_ID = constant("lib/gbuffer/guide.h", "GUIDE_ID")
SLEEPING = float_constant("lib/gbuffer/guide.h", "SLEEPING")
WIDTH, HEIGHT = 150, 20


def moving(frame: int, *, equirect: bool) -> GBuffer:
    """A patch that crosses the picture, and leaves it for some frames."""
    gbuffer = random_gbuffer(WIDTH, HEIGHT, equirect=equirect)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    inside = (np.abs(x - 37 * frame % WIDTH) < 25 - y) & (y > 3)
    return replace(gbuffer, ids=np.where(inside & (frame % 7 < 5), gbuffer.ids, 0.0))


def test_lists_hold_the_surfaces_of_three_pictures(device: ComputeDevice) -> None:
    guide = moving(0, equirect=False).guide(device)
    seen = [moving(0, equirect=False).seen_ids > 0.0]
    tiles = np.arange(guide.tiles.across * guide.tiles.down).reshape(guide.tiles.down, -1)
    of_pixel = np.kron(tiles, np.ones((TILE, TILE), int))[:HEIGHT, :WIDTH]
    for frame in range(1, 9):
        gbuffer = moving(frame, equirect=False)
        gbuffer.fill(device, guide)
        seen.append(gbuffer.seen_ids > 0.0)
        count, *listed = device.read(guide.tiles.lists)[0]
        expected = np.unique(of_pixel[np.any(seen[-3:], axis=0)])
        assert sorted(listed[:count]) == expected.tolist()


@pytest.mark.parametrize("published", [False, True])
@pytest.mark.parametrize("kind", ["delta", "diffuse", "specular"])
@pytest.mark.parametrize("equirect", [False, True])
def test_what_is_left_out_is_what_it_was(
    device: ComputeDevice, equirect: bool, kind: Kind, published: bool
) -> None:
    """Every picture of a sequence has the bits that it has where all tiles are worked on."""
    rng = np.random.default_rng(3)
    frames = 9
    gbuffers = [moving(frame, equirect=equirect) for frame in range(frames)]
    samples = rng.gamma(2.0, 0.5, (frames, signal_planes(kind), HEIGHT, WIDTH))
    motion = still_motion(WIDTH, HEIGHT) + rng.normal(size=(frames, 2, HEIGHT, WIDTH))

    def run(*, everywhere: bool) -> list[np.ndarray]:
        layout = gbuffers[0].layout
        guide = Guide(device, layout, name="test")
        mask = Mask(device, guide, Settings().mask, name="test")
        choose = Masks(device, [mask])
        signal_filter = SignalFilter(
            device, [Signal("test", kind, guide)], Settings(), published=published
        )
        view = device.upload("view", gbuffers[0].view.kernel_constants())
        traced = device.zeros("traced", layout.shape(signal_planes(kind)))
        roughness = upload(device, layout, np.full((1, HEIGHT, WIDTH), 0.2))
        noise = next(iter(signal_filter.variances), None)
        relight = Relight(
            device, guide, noise, delta=True, sun=False, added_light=False, clamp=4.0, name="test"
        )
        black = device.zeros("black", layout.shape(3))
        cache: Any = EvenCache(device, np.ones(3))
        still = still_frame(device, view)
        pictures = []
        for frame, gbuffer in enumerate(gbuffers):
            gbuffer.fill(device, guide)
            if everywhere:
                count = guide.tiles.lists.shape[1] - 1
                device.write(guide.tiles.lists, np.int32([[count, *range(count)]]))
            context = replace(still, index=frame, moving=frame == 4, changed=frame == 4)
            moved = upload(device, layout, motion[frame])
            choose.run(context.grid, [moved])
            # Rays are traced at pixels with surfaces; elsewhere, planes keep what they hold.
            kept, shown = read(device, layout, traced), gbuffer.seen_ids > 0.0
            device.write(traced, layout.padded(np.where(shown, samples[frame], kept)).astype("f4"))
            glossy = roughness if kind == "specular" else None
            (filtered,) = signal_filter.run(
                [Samples(traced, mask, moved, glossy)], context, radiance=1.0
            )
            pictures.append(read(device, layout, filtered))
            if kind == "delta":
                relight.run(filtered, black, WORLD, cache, mask.touched)
                pictures.append(device.read(relight.ratio))
        return pictures

    for part, whole in zip(run(everywhere=False), run(everywhere=True), strict=True):
        np.testing.assert_array_equal(part, whole)
    assert np.ptp(part) > 0.0


class Wall:
    """A wall of 8 x 5 tiles, in front of which an object covers a pixel of tile (1, 1)."""

    def __init__(self, device: ComputeDevice) -> None:
        self.device = device
        self.gbuffer = gbuffer = flat_gbuffer(8 * TILE, 5 * TILE)
        self.layout = layout = gbuffer.layout
        self.tiles = Tiles(device, layout, name="test", layers=2)
        self.guides = [Guide(device, layout, name="test", tiles=self.tiles) for _ in range(2)]
        self.motion = still_motion(*layout.size)
        self.moved = upload(device, layout, self.motion)
        covered = np.zeros_like(gbuffer.ids)
        covered[TILE + 3, TILE + 5] = 1.0
        planes = [upload(device, layout, p) for p in (gbuffer.normal, gbuffer.depth[None])]
        ids = [upload(device, layout, i[None]) for i in (gbuffer.ids, covered)]
        self.layers = [Layer(*planes, ids[0], self.moved), Layer(*planes, ids[1])]
        self.gather = Guides(device, self.guides, self.layers, objects=1)
        self.view = device.upload("view", gbuffer.view.kernel_constants())
        self.gather.run(self.view)

    def awake(self, influence: dict[tuple[int, int], float], **how: Any) -> set[tuple[int, int]]:
        """Tiles (column, row) of the wall that are awake after a picture with this influence."""
        last = np.zeros((2, 5, 8), np.float32)
        for (column, row), value in influence.items():
            last[0, row, column] = value
        self.device.write(self.tiles.influence, last.reshape(2, -1))
        self.gather.run(self.view, **{"least": 1.0, "wake": False} | how)
        ids = read(self.device, self.layout, self.guides[0].current)[GUIDE_ID]
        of_tiles = ids.reshape(5, TILE, 8, TILE).swapaxes(1, 2).reshape(5, 8, -1)
        assert (np.ptp(of_tiles, -1) == 0.0).all()
        assert set(np.unique(ids)) <= {SLEEPING, 1.0}
        return {(int(x), int(y)) for y, x in np.argwhere(of_tiles[..., 0] > 0.0)}


def around(column: int, row: int) -> set[tuple[int, int]]:
    return {
        (x, y)
        for x in range(max(column - 1, 0), min(column + 2, 8))
        for y in range(max(row - 1, 0), min(row + 2, 5))
    }


EVERYWHERE = {(x, y) for x in range(8) for y in range(5)}


def test_tiles_sleep_where_objects_have_no_visible_influence(device: ComputeDevice) -> None:
    wall = Wall(device)
    assert wall.awake({(6, 3): 1.5, (2, 4): 0.9}) == around(1, 1) | {(6, 3)}
    assert wall.awake({(6, 3): 4.5}) == around(1, 1) | around(6, 3)
    assert wall.awake({(6, 3): 4.5}, least=5.0) == around(1, 1)
    assert wall.awake({}, wake=True) == EVERYWHERE


def test_influence_is_carried_to_where_its_surface_is_now(device: ComputeDevice) -> None:
    wall = Wall(device)
    shown = wall.motion.copy()
    shown[0] += TILE  # the view turns: surfaces were a tile further right, the last ones unseen
    device.write(wall.moved, device.read(upload(device, wall.layout, shown)))
    unseen = {(7, y) for y in range(5)}
    assert wall.awake({(4, 3): 1.5}) == around(1, 1) | {(3, 3)} | unseen
    carried = device.read(wall.tiles.influence)[0].reshape(5, 8)
    assert carried[3, 3] == pytest.approx(1.5 * 0.7)
    shown[:, 4 * TILE : 5 * TILE, : 2 * TILE] = -1e9  # nowhere
    device.write(wall.moved, device.read(upload(device, wall.layout, shown)))
    assert wall.awake({}) == around(1, 1) | unseen | {(0, 4), (1, 4)}


def test_sleeping_tiles_leave_the_list_after_two_pictures(device: ComputeDevice) -> None:
    wall = Wall(device)
    lengths = []
    for _ in range(4):
        wall.awake({})
        lengths.append(int(device.read(wall.tiles.lists)[0, 0]))
    assert lengths == [40, 40, 9, 9]


def test_probes_are_traced_in_sleeping_tiles(device: ComputeDevice) -> None:
    wall = Wall(device)
    awake = wall.awake({})
    mask = Mask(device, wall.guides[0], Settings().mask, name="test", graded=True)
    masks, probes = Masks(device, [mask]), Probes(device, [mask], wall.layers[:1])
    found = set()
    for frame in range(3):
        masks.run(tracing_grids(device)[0], [wall.moved])
        own = int(device.read(mask.count)[0])
        probes.place(wall.view, frame)
        listed = device.read(mask.traced)[: int(device.read(mask.count)[0])]
        pixels = listed[own:]
        y, x = np.divmod(pixels, wall.layout.width)
        tiles = list(zip(x // TILE, y // TILE, strict=True))
        assert sorted(tiles) == sorted(PROBES * list(EVERYWHERE - awake))
        guide = read(device, wall.layout, wall.guides[0].current)[:, y, x]
        expected = wall.gbuffer.planes[:, y, x]
        np.testing.assert_allclose(guide[:GUIDE_ID], expected[:GUIDE_ID], atol=1e-5)
        assert (guide[GUIDE_ID] == -expected[GUIDE_ID]).all()
        found |= set(pixels.tolist())
    assert len(found) > 2.9 * len(pixels)


@pytest.mark.parametrize("relit", [True, False])
def test_influence_is_what_rows_and_probes_show(device: ComputeDevice, relit: bool) -> None:
    wall = Wall(device)
    awake = wall.awake({}, least=1.0)
    mask = Mask(device, wall.guides[0], Settings().mask, name="test", graded=True)
    Masks(device, [mask]).run(tracing_grids(device)[0], [wall.moved])
    Probes(device, [mask], wall.layers[:1]).place(wall.view, 0)
    rng = np.random.default_rng(2)
    height, width = wall.gbuffer.ids.shape
    color, ratio = rng.random((3, height, width)), rng.uniform(0.5, 1.5, (height, width, 4))
    signal = rng.random((6, height, width))
    samples = upload(device, wall.layout, signal if relit else signal[:3])
    change = Change(samples, filtered=upload(device, wall.layout, color))
    if relit:
        factors = device.upload("ratio", ratio.reshape(-1, 4).astype(np.float32))
        change = Change(samples, ratio=factors, color=upload(device, wall.layout, color))
    Influence(device, [mask]).measure([change])
    found = device.read(wall.tiles.influence)[0].reshape(5, 8)
    shown = color * (np.moveaxis(ratio[..., :3], -1, 0) - 1.0) if relit else color
    rows = np.abs(shown.reshape(3, height, 8, TILE).mean(-1)).max(0)
    of_probes = np.abs(color * (signal[3:] - signal[:3]) if relit else signal[:3]).max(0)
    stride, probes = width + 2 * PAD, device.read(wall.tiles.probes)[0].reshape(5, 8, -1)
    for column, row in EVERYWHERE:
        if (column, row) in awake:
            expected = rows[row * TILE : (row + 1) * TILE, column].max()
        else:
            y, x = np.divmod(probes[row, column], stride)
            expected = 0.5 * 0.125 * of_probes[y - PAD, x - PAD].mean()
        assert found[row, column] == pytest.approx(expected, rel=1e-4)
