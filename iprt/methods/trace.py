"""Tracing: irradiance of real surfaces, and what virtual ones reflect (IPRT Algorithm 1)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.settings.features import Features
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World


def traced_arguments(guide: Guide, mask: Mask, view: cla.Array) -> dict[str, Any]:
    """Those of `TRACED_PARAMETERS` (`cl/lib/methods/traced.h`) that vary from frame to frame."""
    return {
        "guide": guide.current,
        "list": mask.traced,
        "count": mask.count,
        "view": view,
        "touched": mask.touched,
    }


class TraceReal:
    """Changes of irradiance by objects, at the traced pixels of a real layer.

    Attributes
    ----------
    signal : 6 planes
        Valid at the pixels that were traced. Estimator "delta": blocked / E_R rgb, bounce / E_R
        rgb; "ratio": E_R rgb, E_RV rgb, irradiance over π.
    """

    def __init__(
        self, device: ComputeDevice, guide: Guide, features: Features, *, name: str
    ) -> None:
        self._device = device
        self._guide = guide
        self._features = features
        # Its rays look into the view only where this holds layers of the objects.
        equirect = guide.equirect and features.traced_layers
        defines = plane_defines(equirect=equirect, **features.trace_defines())
        kernel = "trace_delta" if features.delta else "trace_real"
        layout = guide.layout
        self.signal = device.zeros(f"{name} signal", layout.shape(6))
        self._kernel = device.kernel(f"methods/{kernel}.cl", kernel, defines).fixed(
            layout.arguments(),
            rays=features.settings.trace.rays,
            frame_seed=features.settings.seed,
            samples=device.zeros(f"{name} samples", layout.shape(1), np.uint32),
            signal=self.signal,
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        cache: IrradianceCache | None,
        *,
        min_solid_angle: float,
    ) -> None:
        """`cache` holds E_R for the estimator "delta", which ignores objects that span less than
        `min_solid_angle` sr.
        """
        guide = self._guide
        with self._device.profile.section("trace real"):
            self._kernel(
                (guide.layout.width * guide.layout.height,),
                traced_arguments(guide, mask, view),
                world.arguments(self._features),
                {} if cache is None else cache.arguments(world.panorama),
                {} if cache is None else {"min_solid_angle": min_solid_angle},
            )


class TraceVirtual:
    """Light that visible virtual surfaces reflect, at the traced pixels.

    Attributes
    ----------
    diffuse : 3 planes or None
        Irradiance over π, without albedo; None when no material has a diffuse part.
    specular : 3 planes or None
        Radiance; None when no material has a specular part.
    hit : 1 plane or None
        Metres to what the specular lobe reflects, 1e6: the sky, 0: nothing; None as `specular`.
    """

    def __init__(self, device: ComputeDevice, guide: Guide, features: Features) -> None:
        self._device = device
        self._guide = guide
        self._features = features
        defines = guide.defines(
            **features.relit_defines(),
            JITTER=features.jitter,
            **features.gloss_defines(),
        )
        layout = guide.layout
        self.diffuse = self.specular = self.hit = None
        if features.diffuse_signal:
            self.diffuse = device.zeros("diffuse signal", layout.shape(3))
        if features.specular_signal:
            self.specular = device.zeros("specular signal", layout.shape(3))
            self.hit = device.zeros("specular hit distance", layout.shape(1))
        self._kernel = device.kernel("methods/trace_virtual.cl", "trace_virtual", defines).fixed(
            layout.arguments(),
            {"diffuse": self.diffuse, "specular": self.specular, "hit_distance": self.hit},
            rays=features.settings.trace.object_rays,
            frame_seed=features.settings.seed,
            samples=device.zeros("object samples", layout.shape(1), np.uint32),
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        albedo: cla.Array,
        history: cla.Array,
    ) -> None:
        """`history` is the `Temporal.length` of the signals."""
        guide = self._guide
        with self._device.profile.section("trace virtual"):
            self._kernel(
                (guide.layout.width * guide.layout.height,),
                traced_arguments(guide, mask, view),
                world.arguments(self._features),
                albedo=albedo,
                history=history,
            )


class TraceGloss:
    """Reflected objects, less what they hide, at the traced pixels of glossy real surfaces.

    Attributes
    ----------
    change : 3 planes
        Radiance of either sign; valid at the pixels that were traced.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
    ) -> None:
        """Ids of `guide` are indices of the real materials + 1."""
        self._device = device
        self._guide = guide
        self._features = features
        defines = guide.defines(
            **features.relit_defines(),
            **features.gloss_defines(),
        )
        layout = guide.layout
        self.change = device.zeros("gloss signal", layout.shape(3))
        self._kernel = device.kernel("methods/trace_gloss.cl", "trace_gloss", defines).fixed(
            layout.arguments(),
            rays=features.settings.trace.rays,
            frame_seed=features.settings.seed,
            samples=device.zeros("gloss samples", layout.shape(1), np.uint32),
            change=self.change,
        )

    def run(self, world: World, mask: Mask, view: cla.Array) -> None:
        guide = self._guide
        with self._device.profile.section("trace gloss"):
            self._kernel(
                (guide.layout.width * guide.layout.height,),
                traced_arguments(guide, mask, view),
                world.arguments(self._features),
            )
