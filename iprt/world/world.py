"""World for rays: real scene and virtual objects, as kernel arguments."""

from __future__ import annotations

from typing import Any, Protocol

import pyopencl.array as cla

from iprt.device.vectors import int4
from iprt.geometry.camera import View
from iprt.settings.features import Features
from iprt.world.objects.object_layers import EMPTY
from iprt.world.objects.objects import Objects
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.real.lights import Lights, no_lights
from iprt.world.real.panorama import Panorama
from iprt.world.real.real_world import RealWorld


class Substitute(Protocol):
    """Surroundings that rays meet instead of the panorama's surfaces."""

    @property
    def lights(self) -> Lights | None:
        """Lights for light sampling; None: rays are not aimed."""

    def arguments(self) -> dict[str, Any]:
        """Return the further arguments of kernels built with `-D IMPOSTOR`."""


class World:
    """World for rays in one view: real scene and objects, as kernel arguments.

    Attributes
    ----------
    real : RealWorld
    objects : Objects
    impostor : Substitute or None
        Replaces `real` for rays, once the method has placed it.
    """

    def __init__(self, real: RealWorld, objects: Objects) -> None:
        self.real = real
        self.objects = objects
        self.impostor: Substitute | None = None
        self._relit: dict[str, Any] = {
            "relit_screen": None,
            "relit_view": None,
            "relit_width": 0,
            "relit_height": 0,
            "relit_panorama": None,
            "relit_rows": 0,
        }

    @property
    def panorama(self) -> Panorama:
        """Panorama of the real world."""
        return self.real.panorama

    @property
    def irradiance(self) -> IrradianceCache | None:
        """Cache of E_R, where the method needs it."""
        return self.real.irradiance

    @property
    def lights(self) -> Lights | None:
        """Light sampling table; None: no light sampling."""
        return self.real.lights if self.impostor is None else self.impostor.lights

    @property
    def bounds(self) -> cla.Array:
        """`object_bounds()` of the objects."""
        return self.objects.device_bounds

    def relight(
        self,
        screen: cla.Array,
        view: View,
        constants: cla.Array,
        around: tuple[cla.Array, int] | None,
    ) -> None:
        """Let virtual surfaces reflect relit real ones: by `screen` in the view, else by `around`.

        Parameters
        ----------
        screen : (H * W, 4) float32
            `Relight.ratio` of the view, whose constants on the device are `constants`.
        around : ((2 * rows * rows, 4) float32, rows) or None
            `RatioMap.ratio`; None: the view shows the whole panorama.
        """
        self._relit |= {
            "relit_screen": screen,
            "relit_view": constants,
            "relit_width": view.width,
            "relit_height": view.height,
        }
        if around is not None:
            self._relit["relit_panorama"], self._relit["relit_rows"] = around

    def arguments(self, features: Features) -> dict[str, Any]:
        """Return `WORLD_PARAMETERS` of `cl/lib/world/world.h`, for all variants of kernels."""
        trace, real, objects = features.settings.trace, self.real, self.objects
        return {
            **self.panorama.arguments(trace),
            "real_color": self.panorama.radiated,
            **(objects.bvh.arguments() if objects.bvh else self._layers()),
            "objects_bounds": self.bounds,
            "objects_count": self.bounds.shape[0],
            "materials": objects.materials,
            "max_bounces": trace.bounces,
            **(no_lights("light") if real.lights is None else real.lights.arguments()),
            **(self.impostor.arguments() if self.impostor else {}),
            **self._relit,
            **(real.highlight.arguments() if real.highlight else {}),
        }

    def _layers(self) -> dict[str, Any]:
        screen, around = self.objects.screen, self.objects.around
        return {
            **(screen.arguments("screen") if screen else {}),
            **(around.arguments("equirect") if around else {}),
            "objects_rectangle": int4(screen.rect if screen else EMPTY),
        }
