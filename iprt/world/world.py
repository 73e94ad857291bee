"""What rays meet: the real scene and the virtual objects, as kernel arguments."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.geometry.camera import View
from iprt.settings.features import Features
from iprt.world.objects.object_bvh import ObjectBvh
from iprt.world.objects.object_layers import EMPTY, NO_LAYERS, TracedLayers, int4
from iprt.world.real.highlight import Highlight
from iprt.world.real.lights import Lights
from iprt.world.real.panorama import Panorama

NO_LIGHTS: tuple[Any, ...] = (None, None, None, 0, 1, 1)
"""In place of `Lights.arguments()` where nothing is aimed at lights."""
NOT_RELIT: tuple[Any, ...] = (None, None, 0, 0, None, 0)
"""Where real surfaces radiate what the panorama shows."""

NO_GLOSS: tuple[Any, ...] = (None, None, None, None, 1, 1)
"""In place of `Highlight.arguments()` where real surfaces are diffuse."""


class World:
    """What rays meet: the real scene and the objects, as kernel arguments."""

    def __init__(
        self,
        panorama: Panorama,
        screen: TracedLayers | None,
        equirect: TracedLayers | None,
        *,
        bvh: ObjectBvh | None,
        materials: cla.Array,
        bounds: cla.Array,
        lights: Lights | None,
        highlight: Highlight | None = None,
    ) -> None:
        """Objects are the triangles of `bvh`, or else the layers `screen` and `equirect`.

        `materials` holds `material_table()`, `bounds` `object_bounds()`; `lights` are those of the
        panorama, where rays are aimed at them; `highlight` knows the glossy surfaces, where there
        are any.
        """
        self.panorama = panorama
        self.screen = screen
        self.equirect = equirect
        self.bvh = bvh
        self.materials = materials
        self.bounds = bounds
        self.lights = lights
        self.highlight = highlight
        self.relit: tuple[Any, ...] = NOT_RELIT

    def relight(
        self,
        screen: cla.Array,
        view: View,
        constants: cla.Array,
        around: tuple[cla.Array, int] | None,
    ) -> None:
        """Let virtual surfaces reflect real ones relit: by `screen` in the view, else by `around`.

        Parameters
        ----------
        screen : (H * W, 4) float32
            `Relight.ratio` of the view, whose constants on the device `constants` are.
        around : ((2 * rows * rows, 4) float32, rows) or None
            `RatioMap.ratio`; None: the view shows the whole panorama.
        """
        there = around or (None, 0)
        self.relit = (screen, constants, view.width, view.height, *there)

    def arguments(self, features: Features) -> tuple[Any, ...]:
        """What `WORLD_PARAMETERS` of `cl/lib/world/world.h` declares, in order."""
        trace = features.settings.trace
        return (
            *self.panorama.layer_arguments(trace.thickness, trace.thickness_ratio),
            self.panorama.radiated,
            self.panorama.outside,
            *self.panorama.background_arguments(),
            *(self.bvh.arguments() if self.bvh else self._layers()),
            self.bounds,
            self.bounds.shape[0],
            self.materials,
            *(self.lights.arguments() if self.lights else NO_LIGHTS),
            *self.relit,
            *(self.highlight.arguments() if self.highlight else NO_GLOSS),
        )

    def _layers(self) -> tuple[Any, ...]:
        return (
            *(self.screen.arguments() if self.screen else NO_LAYERS),
            *(self.equirect.arguments() if self.equirect else NO_LAYERS),
            int4(self.screen.rect if self.screen else EMPTY),
        )
