"""Influence of the objects on tiles of real surfaces, which decides which tiles sleep."""

from __future__ import annotations

from collections.abc import Sequence

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask
from iprt.gbuffer.batch import batched
from iprt.gbuffer.guide import Layer

VISIBLE = 0.001 / 0.18
"""Visible change over the panorama's mean radiance: a thousandth of white, if the mean is middle
gray."""


class Probes:
    """Probes of sleeping tiles: a few of their pixels are traced in each frame."""

    def __init__(
        self, device: ComputeDevice, masks: Sequence[Mask], layers: Sequence[Layer]
    ) -> None:
        """Create the kernel for layers that may sleep, with one mask each."""
        self._masks = masks
        guides = [mask.guide for mask in masks]
        self._tiles = tiles = guides[0].tiles
        self._place = device.kernel(
            "filter/influence.cl", "place_probes", guides[0].defines()
        ).fixed(
            guides[0].layout.arguments(),
            batched(
                normal=[layer.normal for layer in layers],
                depth=[layer.depth for layer in layers],
                id=[layer.ids for layer in layers],
                layer=[guide.layer for guide in guides],
                list=[mask.traced for mask in masks],
                count=[mask.count for mask in masks],
            ),
            states=tiles.states,
            probes=tiles.probes,
        )

    def place(self, view: cla.Array, frame: int) -> None:
        """Add the probes to the lists of traced pixels.

        Parameters
        ----------
        view : (16,) float32
            `View.kernel_constants()`.
        frame : int
            Number that differs between frames.
        """
        self._place(
            (self._tiles.across, self._tiles.down, len(self._masks)),
            batched(guide=[mask.guide.current for mask in self._masks]),
            view=view,
            frame=frame,
        )


class Influence:
    """Measurement of the influence on the tiles of a layer that may sleep."""

    def __init__(self, device: ComputeDevice, mask: Mask, kernel: str) -> None:
        """Create the kernel: `judge_relit` or `judge_gloss`."""
        self._layout, self._tiles = mask.guide.layout, mask.guide.tiles
        self._judge = device.kernel("filter/influence.cl", kernel, mask.guide.defines()).fixed(
            self._layout.arguments(),
            layer=mask.guide.layer,
            states=self._tiles.states,
            probes=self._tiles.probes,
        )

    def measure(self, **planes: cla.Array | None) -> None:
        """Update `Tiles.influence` by the kernel's planes of this frame."""
        size = self._tiles.across, self._layout.height
        self._judge(size, influence=self._tiles.influence, **planes)
