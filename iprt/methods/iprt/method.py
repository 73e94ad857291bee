"""The default method: IPRT with what it was found to lack."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.gbuffer.context import FrameContext
from iprt.method import Setup
from iprt.methods.iprt.ratio_map import RatioMap
from iprt.trace.sparse import SparseMethod
from iprt.world.world import World


class Iprt(SparseMethod):
    """Objects reflect real surfaces relit beside the view too."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        device, features = setup.device, setup.features
        self._ratio_map: RatioMap | None = None
        if features.ratio_map:
            self._ratio_map = RatioMap(device, features, setup.camera)

    def relight_around(self, world: World, context: FrameContext) -> tuple[cla.Array, int] | None:
        if self._ratio_map is None:
            return None
        self._ratio_map.run(world, context)
        return self._ratio_map.ratio, self._ratio_map.rows
