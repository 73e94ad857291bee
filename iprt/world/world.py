"""World for rays: real scene and virtual objects, as kernel arguments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import pyopencl.array as cla

from iprt.device.block import Block, Float2, Float4s, Float32, Floats, Int32, when
from iprt.device.vectors import float2
from iprt.geometry.camera import View
from iprt.settings.features import Features
from iprt.world.objects.object_bvh import ObjectsArgs
from iprt.world.objects.objects import Objects
from iprt.world.real.highlight import GlossArgs
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.real.lights import Lights, LightsArgs
from iprt.world.real.panorama import ImpostorArgs, Panorama, RealLayerArgs
from iprt.world.real.real_world import RealWorld


@dataclass(kw_only=True)
class RelitArgs(Block):
    """Factors by which objects change the radiance of real surfaces; by default none.

    Attributes
    ----------
    screen : (width * height, 4) float32 or None
        Per pixel of the view.
    view : (16,) float32
        `View.kernel_constants()` of `screen`.
    width, height : int
    size : float2
        Width and height: see `GridArgs`.
    panorama : (2 * rows * rows, 4) float32 or None
        Equirect.
    rows : int
    panorama_size : float2
        Its columns and rows.
    """

    screen: Float4s = None
    view: Floats = None
    width: Int32 = 0
    height: Int32 = 0
    panorama: Float4s = None
    rows: Int32 = 0
    size: Float2 = None
    panorama_size: Float2 = None

    def __post_init__(self) -> None:
        self.size = float2(self.width, self.height)
        self.panorama_size = float2(2 * self.rows, self.rows)


@dataclass(kw_only=True)
class WorldArgs(Block):
    """Mixed scene for rays (`cl/lib/world/world.h`).

    Attributes
    ----------
    real, objects, lights, relit, gloss
    materials : (rows, 4) float32
        `material_table()` of the objects.
    max_bounces : int
        Virtual surfaces that a path may meet.
    mean_radiance : float
        `Panorama.mean_radiance`.
    """

    real: RealLayerArgs
    objects: ObjectsArgs
    materials: Float4s
    max_bounces: Int32
    lights: LightsArgs
    relit: RelitArgs = when("RELIT")
    gloss: GlossArgs | None = when("GLOSS")
    mean_radiance: Float32 = when("SUN")


class Substitute(Protocol):
    """Surroundings that rays meet instead of the panorama's surfaces."""

    @property
    def lights(self) -> Lights | None:
        """Lights for light sampling; None: rays are not aimed."""

    def arguments(self) -> ImpostorArgs:
        """Return the surroundings for kernels built with `-D IMPOSTOR`."""


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
        self._relit = RelitArgs()

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
        panorama, rows = (None, 0) if around is None else around
        self._relit = RelitArgs(
            screen=screen,
            view=constants,
            width=view.width,
            height=view.height,
            panorama=panorama,
            rows=rows,
        )

    def arguments(
        self, features: Features, view: cla.Array | None, *, captured: bool = False
    ) -> WorldArgs:
        """Return the world for all variants of kernels.

        Parameters
        ----------
        features : Features
        view : (16,) float32 or None
            `View.kernel_constants()`, for objects as layers.
        captured : bool
            For kernels built without `-D IMPOSTOR`: rays meet the panorama's surfaces.
        """
        trace, real = features.settings.trace, self.real
        lights = real.lights if captured else self.lights
        impostor = None if self.impostor is None else self.impostor.arguments()
        return WorldArgs(
            real=replace(
                self.panorama.arguments(trace), color=self.panorama.radiated, impostor=impostor
            ),
            objects=self.objects.arguments(view),
            materials=self.objects.materials,
            max_bounces=trace.bounces,
            lights=LightsArgs() if lights is None else lights.arguments(),
            relit=self._relit,
            gloss=real.highlight.arguments() if real.highlight else None,
            mean_radiance=self.panorama.mean_radiance,
        )
