"""What rays meet: the real scene and the virtual objects, as kernel arguments."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.geometry.camera import View
from iprt.settings.features import Features
from iprt.world.objects.object_layers import EMPTY, NO_LAYERS, int4
from iprt.world.objects.objects import Objects
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.real.panorama import Panorama
from iprt.world.real.real_world import RealWorld

NO_LIGHTS: tuple[Any, ...] = (None, None, None, 0, 1, 1)
"""In place of `Lights.arguments()` where nothing is aimed at lights."""
NOT_RELIT: tuple[Any, ...] = (None, None, 0, 0, None, 0)
"""Where real surfaces radiate what the panorama shows."""

NO_GLOSS: tuple[Any, ...] = (None, None, None, None, 1, 1)
"""In place of `Highlight.arguments()` where real surfaces are diffuse."""


class World:
    """What rays meet in one view: the real scene and the objects, as kernel arguments.

    Attributes
    ----------
    real : RealWorld
    objects : Objects
    """

    def __init__(self, real: RealWorld, objects: Objects) -> None:
        self.real = real
        self.objects = objects
        self.relit: tuple[Any, ...] = NOT_RELIT

    @property
    def panorama(self) -> Panorama:
        return self.real.panorama

    @property
    def irradiance(self) -> IrradianceCache | None:
        """E_R, where the method needs it."""
        return self.real.irradiance

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
        trace, real, objects = features.settings.trace, self.real, self.objects
        return (
            *self.panorama.layer_arguments(trace.thickness, trace.thickness_ratio),
            self.panorama.radiated,
            self.panorama.outside,
            *self.panorama.background_arguments(),
            *(objects.bvh.arguments() if objects.bvh else self._layers()),
            self.bounds,
            self.bounds.shape[0],
            objects.materials,
            *(real.lights.arguments() if real.lights else NO_LIGHTS),
            *self.relit,
            *(real.highlight.arguments() if real.highlight else NO_GLOSS),
        )

    def _layers(self) -> tuple[Any, ...]:
        screen, equirect = self.objects.screen, self.objects.equirect
        return (
            *(screen.arguments() if screen else NO_LAYERS),
            *(equirect.arguments() if equirect else NO_LAYERS),
            int4(screen.rect if screen else EMPTY),
        )
