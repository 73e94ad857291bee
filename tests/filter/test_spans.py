"""Passes work on the columns that a layer's surfaces span, with the same result."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask, Masks
from iprt.filter.signal_filter import Samples, SignalFilter
from iprt.filter.signals import Kind, Signal, signal_planes
from iprt.gbuffer.guide import Guide, span_arguments
from iprt.settings.model import Settings
from iprt.trace.relight import Relight
from tests.filter.gbuffer import GBuffer, random_gbuffer, read, still_frame, still_motion, upload
from tests.trace.even_cache import WORLD, EvenCache

WIDTH, HEIGHT = 150, 20


def moving(frame: int, *, equirect: bool) -> GBuffer:
    """A patch that crosses the picture, and leaves it for some frames."""
    gbuffer = random_gbuffer(WIDTH, HEIGHT, equirect=equirect)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    inside = (np.abs(x - 37 * frame % WIDTH) < 25 - y) & (y > 3)
    return replace(gbuffer, ids=np.where(inside & (frame % 7 < 5), gbuffer.ids, 0.0))


def test_spans_hold_the_surfaces_of_three_pictures(device: ComputeDevice) -> None:
    guide = moving(0, equirect=False).guide(device)
    seen = [moving(0, equirect=False).seen_ids > 0.0]
    for frame in range(1, 9):
        gbuffer = moving(frame, equirect=False)
        gbuffer.fill(device, guide)
        seen.append(gbuffer.seen_ids > 0.0)
        first, end = np.moveaxis(device.read(guide.spans.rows)[0], -1, 0)
        columns = np.arange(WIDTH)
        spanned = (columns >= first[:, None]) & (columns < end[:, None])
        recent = np.any(seen[-3:], axis=0)
        found = recent.any(1)
        assert not spanned[~found].any()
        assert (first[found] == recent.argmax(1)[found]).all()
        assert (end[found] == WIDTH - recent[:, ::-1].argmax(1)[found]).all()


@pytest.mark.parametrize("published", [False, True])
@pytest.mark.parametrize("kind", ["delta", "diffuse", "specular"])
@pytest.mark.parametrize("equirect", [False, True])
def test_what_is_left_out_is_what_it_was(
    device: ComputeDevice, equirect: bool, kind: Kind, published: bool
) -> None:
    """Every picture of a sequence has the bits that it has where all columns are worked on."""
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
        spans = span_arguments([guide]) if everywhere else signal_filter.spans
        noise = next(iter(signal_filter.variances), None)
        relight = Relight(device, guide, spans, noise, delta=True, name="test")
        black = device.zeros("black", layout.shape(3))
        cache: Any = EvenCache(device, np.ones(3))
        still = still_frame(device, view)
        pictures = []
        for frame, gbuffer in enumerate(gbuffers):
            gbuffer.fill(device, guide)
            if everywhere:
                whole = np.tile(np.int32([0, WIDTH]), (1, HEIGHT, 1))
                device.write(guide.spans.rows, whole)
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
