"""The default method: IPRT, with reflections of surfaces that are relit outside the view."""

from __future__ import annotations

from iprt.gbuffer.context import FrameContext
from iprt.method import Setup
from iprt.methods.iprt.ratio_map import RatioMap
from iprt.passes import Pass
from iprt.trace.sparse import Around, SparseMethod
from iprt.world.world import World


class Iprt(SparseMethod):
    """IPRT in which objects also reflect real surfaces that are relit outside the view."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        device, features = setup.device, setup.features
        self._ratio_map: RatioMap | None = None
        if features.ratio_map:
            self._ratio_map = RatioMap(device, features, setup.camera)

    def relight_around(self, world: World) -> tuple[Around, list[Pass[FrameContext]]]:
        """Return the ratio map's ratio and rows, and its passes."""
        found = self._ratio_map
        return (None, []) if found is None else ((found.ratio, found.rows), found.passes(world))
