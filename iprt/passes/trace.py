"""Tracing: irradiance of real surfaces, and what virtual ones reflect (IPRT Algorithm 1)."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.passes.guide import Guide, plane_defines
from iprt.passes.mask import Mask
from iprt.passes.world import World
from iprt.requirements import Requirements


class TraceReal:
    """E_R and E_RV at the traced pixels of the real layer.

    Attributes
    ----------
    signal : 6 planes
        E_R rgb, E_RV rgb: irradiance over π; valid at the pixels that were traced.
    """

    def __init__(self, device: ComputeDevice, guide: Guide, requirements: Requirements) -> None:
        self._device = device
        self._guide = guide
        self._requirements = requirements
        defines = plane_defines(equirect=guide.equirect, **requirements.trace_defines())
        self._kernel = device.kernel("trace_real.cl", "trace_real", defines)
        layout = guide.layout
        self.signal = device.zeros("real signal", layout.shape(6))
        self._samples = device.zeros("real samples", layout.shape(1), np.uint32)

    def run(self, world: World, mask: Mask, view: cla.Array) -> None:
        layout, settings = self._guide.layout, self._requirements.settings
        with self._device.profile.section("trace real"):
            self._kernel(
                (layout.width * layout.height,),
                layout.width,
                layout.height,
                settings.trace.rays,
                settings.seed,
                mask.traced,
                mask.count,
                self._guide.current,
                view,
                *world.arguments(self._requirements),
                self._samples,
                self.signal,
                mask.touched,
            )


class TraceVirtual:
    """What the visible virtual surfaces reflect, at the traced pixels.

    Attributes
    ----------
    diffuse : 3 planes or None
        Irradiance over π, without albedo; None when no material has a diffuse part.
    specular : 3 planes or None
        Radiance; None when no material has a specular part.
    """

    def __init__(self, device: ComputeDevice, guide: Guide, requirements: Requirements) -> None:
        self._device = device
        self._guide = guide
        self._requirements = requirements
        relit = requirements.tracing and requirements.settings.trace.relight_reflections
        defines = plane_defines(
            equirect=guide.equirect, RELIT=relit, **requirements.trace_defines()
        )
        self._kernel = device.kernel("trace_virtual.cl", "trace_virtual", defines)
        layout = guide.layout
        self.diffuse = self.specular = None
        if requirements.diffuse_signal:
            self.diffuse = device.zeros("diffuse signal", layout.shape(3))
        if requirements.specular_signal:
            self.specular = device.zeros("specular signal", layout.shape(3))
        self._samples = device.zeros("object samples", layout.shape(1), np.uint32)

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        albedo: cla.Array,
        ratio: cla.Array | None,
    ) -> None:
        layout, settings = self._guide.layout, self._requirements.settings
        with self._device.profile.section("trace virtual"):
            self._kernel(
                (layout.width * layout.height,),
                layout.width,
                layout.height,
                settings.trace.rays,
                settings.seed,
                mask.traced,
                mask.count,
                self._guide.current,
                albedo,
                view,
                ratio,
                *world.arguments(self._requirements),
                self._samples,
                self.diffuse,
                self.specular,
                mask.touched,
            )
