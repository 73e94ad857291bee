"""Tiles of a view on which image-space passes work."""

from __future__ import annotations

import numpy as np

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.gbuffer.layout import PlaneLayout

TILE = constant("lib/gbuffer/batch.h", "TILE")
"""Side of a tile in pixels."""

PROBES = constant("lib/gbuffer/tiles.h", "PROBES")
"""Rays that a sleeping tile sends in each frame."""


class Tiles:
    """Tiles of the layers of a view, and the lists of those to work on. `Guides` fills them.

    Attributes
    ----------
    across, down : int
        Number of tiles along the view's sides.
    lists : (layers, 1 + tiles) int32
        Length of each list, then the tiles, numbered row by row.
    states : (layers, tiles) int32
        See `cl/lib/gbuffer/tiles.h`.
    seen : (layers, H, across) uint8
        Whether a row of a tile shows surfaces.
    influence, before : (layers, tiles) float32
        Influence of the objects on tiles of this picture and of the previous one, radiance. Only
        of layers that may sleep.
    probes : (layers, tiles, PROBES) int32
        Pixels of sleeping tiles that get a ray; -1: none.
    """

    def __init__(
        self, device: ComputeDevice, layout: PlaneLayout, *, name: str, layers: int = 1
    ) -> None:
        self.across, self.down = -(-layout.width // TILE), -(-layout.height // TILE)
        count = self.across * self.down
        self.lists = device.zeros(f"{name} tiles", (layers, 1 + count), np.int32)
        self.states = device.zeros(f"{name} tile states", (layers, count), np.int32)
        self.seen = device.zeros(
            f"{name} tiles seen", (layers, layout.height, self.across), np.uint8
        )
        self.influence = device.zeros(f"{name} influence", (layers, count))
        self.before = device.zeros(f"{name} influence before", (layers, count))
        self.probes = device.zeros(f"{name} probes", (layers, count, PROBES), np.int32)
        self._taken = 0
        self._wide = device.wide

    def take(self) -> int:
        """Reserve one more layer and return its index."""
        self._taken += 1
        assert self._taken <= self.lists.shape[0]
        return self._taken - 1

    def grid(self, entries: int = 1) -> tuple[int, int, int]:
        """Return the work items of kernels with `TILE_ITEM`."""
        return TILE, TILE * self.across * self.down, entries

    def lanes(self, entries: int = 1) -> tuple[int, int, int]:
        """Return the work items of kernels with `TILE_LANES_ITEM`."""
        return (TILE, self.across * self.down, entries) if self._wide else self.grid(entries)
