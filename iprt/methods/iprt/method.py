"""The default method: IPRT with what it was found to lack."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.gbuffer.context import FrameContext
from iprt.methods.iprt.gloss_pixels import GlossPixels
from iprt.methods.iprt.ratio_map import RatioMap
from iprt.methods.protocol import Setup
from iprt.methods.sparse import SparseMethod
from iprt.world.world import World


class Iprt(SparseMethod):
    """Relights real surfaces in view and around it, and lets glossy ones reflect objects."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        device, features = setup.device, setup.features
        self._ratio_map: RatioMap | None = None
        self._gloss: GlossPixels | None = None
        if features.ratio_map:
            self._ratio_map = RatioMap(device, features, setup.camera)
        if features.gloss:
            self._gloss = GlossPixels(
                device, setup.layout, features, equirect=setup.equirect, camera=setup.camera
            )

    def relight_around(self, world: World, context: FrameContext) -> tuple[cla.Array, int] | None:
        if self._ratio_map is None:
            return None
        self._ratio_map.run(world, context)
        return self._ratio_map.ratio, self._ratio_map.rows

    def reflect(self, world: World, context: FrameContext) -> cla.Array | None:
        if self._gloss is None:
            return None
        return self._gloss.run(world, self.setup.gbuffer.real, context)
