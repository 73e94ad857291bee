"""Layers and signals of a batch get the bits that each gets alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pyopencl.array as cla
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask, Masks
from iprt.filter.signal_filter import Samples, SignalFilter
from iprt.filter.signals import Kind, Signal
from iprt.gbuffer.guide import Guide, Guides, Layer
from iprt.gbuffer.tiles import Tiles
from iprt.settings.filter import MaskSettings
from iprt.settings.model import Settings
from tests.filter.gbuffer import GBuffer, random_gbuffer, read, still_frame, still_motion, upload

WIDTH, HEIGHT = 37, 22
LAYERS = (0, 1, 1)
"""Which G-buffer each signal is of."""
KINDS: tuple[Kind, ...] = ("specular", "specular", "diffuse")
FRAMES = 5
Image = NDArray[np.generic]


class Frames:
    """Frames for any selection of the signals, the fourth with a change."""

    def __init__(self, device: ComputeDevice, *, equirect: bool) -> None:
        self.device = device
        self.gbuffers = [random_gbuffer(WIDTH, HEIGHT, equirect=equirect, seed=s) for s in (1, 2)]
        rng = np.random.default_rng(4)
        shape = (FRAMES, len(LAYERS))
        self.samples = rng.gamma(2.0, 0.5, (*shape, 3, HEIGHT, WIDTH))
        self.motion = still_motion(WIDTH, HEIGHT) + rng.normal(size=(*shape, 2, HEIGHT, WIDTH))
        self.touched = 12.0 * (rng.random((2, HEIGHT, WIDTH)) < 0.6)
        self.roughness = rng.choice([0.0, 0.02, 0.3], (len(LAYERS), HEIGHT, WIDTH))

    def planes(self, image: NDArray[np.float64]) -> cla.Array:
        return upload(self.device, self.gbuffers[0].layout, image)

    def masks(self, guides: Sequence[Guide], used: Sequence[int]) -> list[Mask]:
        """Chosen in one launch, by other settings for each layer."""
        made = []
        for layer in used:
            settings = MaskSettings(sigma_position=0.2 + layer, sparse=layer != 1)
            mask = Mask(self.device, guides[layer], settings, name="test", graded=layer == 0)
            padded = self.gbuffers[layer].layout.padded(self.touched[layer][None])
            self.device.write(mask.touched, padded.astype(np.float32))
            made.append(mask)
        return made

    def run(self, chosen: Sequence[int], published: bool) -> dict[str, Image]:
        """Filter some of the signals together and return their images."""
        device = self.device
        used = sorted({LAYERS[i] for i in chosen})
        layout = self.gbuffers[0].layout
        tiles = Tiles(device, layout, name="test", layers=len(self.gbuffers))
        guides = [Guide(device, layout, name="test", tiles=tiles) for _ in self.gbuffers]
        masks = self.masks(guides, used)
        layers = [layer_of(self, self.gbuffers[i]) for i in used]
        gather = Guides(device, [guides[i] for i in used], layers)
        choose = Masks(device, masks)
        signals = [Signal(f"signal {i}", KINDS[i], guides[LAYERS[i]]) for i in chosen]
        signal_filter = SignalFilter(device, signals, Settings(), published=published)
        view = device.upload("view", self.gbuffers[0].view.kernel_constants())
        still = still_frame(device, view)
        gather.run(view)  # the picture before the first
        for frame in range(FRAMES):
            context = replace(still, index=frame, moving=frame == 3, changed=frame == 3)
            gather.run(view)
            motions = [self.planes(self.motion[frame, i]) for i in used]
            choose.run(context.grid, motions)
            filtered = signal_filter.run(
                [
                    Samples(
                        self.planes(self.samples[frame, i]),
                        masks[used.index(LAYERS[i])],
                        self.planes(self.motion[frame, i]),
                        self.planes(self.roughness[i][None]) if KINDS[i] == "specular" else None,
                    )
                    for i in chosen
                ],
                context,
                radiance=1.0,
            )
        result = {}
        for i, planes, accumulated in zip(chosen, filtered, signal_filter.accumulated, strict=True):
            result[f"filtered {i}"] = read(device, layout, planes)
            result[f"accumulated {i}"] = read(device, layout, accumulated.signal)
            result[f"certainty {i}"] = read(device, layout, accumulated.certainty)
        for layer, mask in zip(used, masks, strict=True):
            result[f"level {layer}"] = read(device, layout, mask.level)
            result[f"touched {layer}"] = read(device, layout, mask.touched)
            count = int(device.read(mask.count)[0])
            result[f"traced {layer}"] = np.sort(device.read(mask.traced)[:count])
        return result


def layer_of(frames: Frames, gbuffer: GBuffer) -> Layer:
    planes = (gbuffer.normal, gbuffer.depth[None], gbuffer.ids[None])
    return Layer(*map(frames.planes, planes))


@pytest.mark.parametrize("published", [False, True])
@pytest.mark.parametrize("equirect", [False, True])
def test_signals_together_and_alone(device: ComputeDevice, equirect: bool, published: bool) -> None:
    frames = Frames(device, equirect=equirect)
    alone = frames.run([0], published) | frames.run([1], published) | frames.run([2], published)
    for batch in ([0, 1, 2], [1, 2]):
        together = frames.run(batch, published)
        assert {int(name[-1]) for name in together if name[:8] == "filtered"} == set(batch)
        for name, image in together.items():
            assert np.array_equal(image, alone[name]), (batch, name)
            assert np.ptp(image) > 0, name
