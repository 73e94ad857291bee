"""Influence of the objects on tiles of real surfaces, which decides which tiles sleep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Change:
    """Change of a layer by the objects in a frame.

    Attributes
    ----------
    samples : planes
        Samples at traced pixels: 6 planes, blocked and bounce over E_R; or radiance, 3 planes,
        where there is no `ratio`.
    ratio : (pixels, 4) float32 or None
        Factor of the captured radiance, per pixel.
    color : 3 planes or None
        Captured radiance, where there is a ratio.
    filtered : 3 planes or None
        Change of the radiance, where there is none.
    """

    samples: cla.Array
    ratio: cla.Array | None = None
    color: cla.Array | None = None
    filtered: cla.Array | None = None


class Influence:
    """Measurement of the influence on the tiles of layers that may sleep."""

    def __init__(self, device: ComputeDevice, masks: Sequence[Mask]) -> None:
        """Create the kernel for layers with one mask each."""
        guides = [mask.guide for mask in masks]
        self._layout, self._tiles = guides[0].layout, guides[0].tiles
        self._judge = device.kernel("filter/influence.cl", "judge", guides[0].defines()).fixed(
            self._layout.arguments(),
            batched(layer=[guide.layer for guide in guides]),
            states=self._tiles.states,
            probes=self._tiles.probes,
        )

    def measure(self, changes: Sequence[Change]) -> None:
        """Update `Tiles.influence` by the changes of the layers in this frame."""
        self._judge(
            (self._tiles.across, self._layout.height, len(changes)),
            batched(
                ratio=[change.ratio for change in changes],
                color=[change.color for change in changes],
                change=[change.filtered for change in changes],
                signal=[change.samples for change in changes],
            ),
            influence=self._tiles.influence,
        )
