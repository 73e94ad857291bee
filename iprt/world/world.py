"""What rays meet: the real scene and the virtual objects, as kernel arguments."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.geometry.camera import View
from iprt.settings.features import Features
from iprt.world.objects.object_bvh import ObjectBvh
from iprt.world.objects.object_layers import EMPTY, TracedLayers, int4
from iprt.world.real.highlight import Highlight
from iprt.world.real.lights import Lights
from iprt.world.real.panorama import Panorama


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
        self._relit: dict[str, Any] = {}

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
        self._relit = {
            "relit_screen": screen,
            "relit_view": constants,
            "relit_width": view.width,
            "relit_height": view.height,
        }
        if around is not None:
            self._relit["relit_panorama"], self._relit["relit_rows"] = around

    def arguments(self, features: Features) -> dict[str, Any]:
        """`WORLD_PARAMETERS` of `cl/lib/world/world.h`, of all variants of kernels."""
        trace = features.settings.trace
        return {
            **self.panorama.arguments(trace.thickness, trace.thickness_ratio),
            "real_color": self.panorama.radiated,
            **(self.bvh.arguments() if self.bvh else self._layers()),
            "objects_bounds": self.bounds,
            "objects_count": self.bounds.shape[0],
            "materials": self.materials,
            **(self.lights.arguments() if self.lights else {}),
            **self._relit,
            **(self.highlight.arguments() if self.highlight else {}),
        }

    def _layers(self) -> dict[str, Any]:
        return {
            **(self.screen.arguments("screen") if self.screen else {}),
            **(self.equirect.arguments("equirect") if self.equirect else {}),
            "objects_rectangle": int4(self.screen.rect if self.screen else EMPTY),
        }
