"""What rays meet: the real scene and the virtual objects, as kernel arguments."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.passes.object_layers import EMPTY, NO_LAYERS, TracedLayers, int4
from iprt.passes.panorama import Panorama
from iprt.requirements import Requirements


class World:
    """What rays meet: the real scene and the layers of the objects, as kernel arguments."""

    def __init__(
        self,
        panorama: Panorama,
        screen: TracedLayers | None,
        equirect: TracedLayers | None,
        *,
        materials: cla.Array,
        bounds: cla.Array,
    ) -> None:
        """`materials` holds `material_table()`, `bounds` `object_bounds()`."""
        self.panorama = panorama
        self.screen = screen
        self.equirect = equirect
        self.materials = materials
        self.bounds = bounds

    def arguments(self, requirements: Requirements) -> tuple[Any, ...]:
        """What `REAL_PARAMETERS` and `OBJECT_PARAMETERS` of `cl/lib/scene.h` declare, in order."""
        trace = requirements.settings.trace
        return (
            *self.panorama.layer_arguments(trace.thickness, trace.thickness_ratio),
            self.panorama.color,
            self.panorama.outside,
            *(self.screen.arguments() if self.screen else NO_LAYERS),
            *(self.equirect.arguments() if self.equirect else NO_LAYERS),
            int4(self.screen.rect if self.screen else EMPTY),
            self.bounds,
            self.bounds.shape[0],
            self.materials,
        )
