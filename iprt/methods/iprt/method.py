"""The default method: IPRT, with reflections of surfaces that are relit outside the view."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.gbuffer.context import FrameContext
from iprt.method import Setup
from iprt.methods.iprt.ratio_map import RatioMap
from iprt.trace.sparse import SparseMethod
from iprt.world.world import World


class Iprt(SparseMethod):
    """IPRT in which objects also reflect real surfaces that are relit outside the view."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        device, features = setup.device, setup.features
        self._ratio_map: RatioMap | None = None
        if features.ratio_map:
            self._ratio_map = RatioMap(device, features, setup.camera)

    def relight_around(self, world: World, context: FrameContext) -> tuple[cla.Array, int] | None:
        """Update the ratio map and return its ratio and rows; None without a map."""
        if self._ratio_map is None:
            return None
        self._ratio_map.run(world, context)
        return self._ratio_map.ratio, self._ratio_map.rows
