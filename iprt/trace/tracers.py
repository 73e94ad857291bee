"""Tracing: irradiance of real surfaces, and what virtual ones reflect (IPRT Algorithm 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.filter.mask import Mask
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.settings.features import Features
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World


def traced_arguments(guide: Guide, mask: Mask, view: cla.Array) -> dict[str, Any]:
    """Those of `TRACED_PARAMETERS` (`cl/lib/trace/traced.h`) that vary from frame to frame."""
    return {
        "guide": guide.current,
        "list": mask.traced,
        "count": mask.count,
        "view": view,
        "touched": mask.touched,
    }


class _Tracer:
    """A kernel that sends rays, or cones, from the traced pixels of a guide's layer."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        kernel: str,
        defines: Mapping[str, Define],
        *,
        name: str | None,
        rays: int,
        planes: Mapping[str, cla.Array | None],
        **own: Any,
    ) -> None:
        """`kernel`: a file of `cl/` without its suffix, and the kernel of that name in it. `name`:
        that of the buffer in which it counts the samples of each pixel; None: it draws none.
        `planes`: what it writes, by parameter. `own`: parameters that only this kernel has.
        """
        self._device, self._guide, self._features = device, guide, features
        layout = guide.layout
        if name is not None:
            own["samples"] = device.zeros(f"{name} samples", layout.shape(1), np.uint32)
        pixels = layout.width * layout.height
        entry = kernel.rpartition("/")[2]
        self._kernel = device.kernel(f"{kernel}.cl", entry, defines, items=pixels).fixed(
            layout.arguments(), planes, rays=rays, frame_seed=features.settings.seed, **own
        )

    def arguments(self, world: World) -> dict[str, Any]:
        """What the rays meet, as kernel arguments."""
        return world.arguments(self._features)

    def _launch(self, section: str, world: World, mask: Mask, view: cla.Array, **more: Any) -> None:
        """`more`: arguments that vary; the kernel may lack some."""
        layout = self._guide.layout
        with self._device.profile.section(section):
            self._kernel(
                (layout.width * layout.height,),
                traced_arguments(self._guide, mask, view),
                self.arguments(world),
                more,
            )


class RealTracer(_Tracer):
    """What objects change in the irradiance of real surfaces, at the traced pixels of a layer.

    Attributes
    ----------
    signal : 6 planes
        Valid at the pixels that were traced. Irradiance that objects hide, and that they send,
        over E_R: rgb each.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        kernel: str,
        defines: Mapping[str, Define],
        *,
        name: str,
        **own: Any,
    ) -> None:
        """`own`: parameters that only this kernel has."""
        self.signal = device.zeros(f"{name} signal", guide.layout.shape(6))
        rays = features.settings.trace.rays
        planes = {"signal": self.signal}
        super().__init__(
            device, guide, features, kernel, defines, name=name, rays=rays, planes=planes, **own
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
        """`cache` holds E_R. Objects that span less than `min_solid_angle` sr may be ignored."""
        known = {} if cache is None else cache.arguments(world.panorama)
        self._launch("trace real", world, mask, view, min_solid_angle=min_solid_angle, **known)


class TraceReal(RealTracer):
    """Changes of irradiance by the estimator "delta", or, by "ratio", irradiance with and without
    objects: then `signal` is E_R rgb and E_RV rgb, irradiance over π, and no cache is needed.
    """

    def __init__(
        self, device: ComputeDevice, guide: Guide, features: Features, *, name: str
    ) -> None:
        # Its rays look into the view only where this holds layers of the objects.
        equirect = guide.layout.equirect and features.traced_layers
        defines = plane_defines(equirect=equirect, **features.trace_defines())
        kernel = "trace/trace_delta" if features.delta else "trace/trace_real"
        super().__init__(device, guide, features, kernel, defines, name=name)


class VirtualTracer(_Tracer):
    """Light that visible virtual surfaces reflect, at the traced pixels.

    Attributes
    ----------
    diffuse : 3 planes or None
        Irradiance over π, without albedo; None when no material has a diffuse part.
    specular : 3 planes or None
        Radiance; None when no material has a specular part.
    hit : 1 plane or None
        Metres to what the specular lobe reflects, 1e6: the sky, 0: nothing; None as `specular`, and
        where the kernel does not find it: the filter then takes reflections as painted on.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        kernel: str,
        defines: Mapping[str, Define],
        *,
        finds_hit: bool = True,
        **own: Any,
    ) -> None:
        """`own`: parameters that only this kernel has."""
        layout = guide.layout
        self.diffuse = self.specular = self.hit = None
        if features.diffuse_signal:
            self.diffuse = device.zeros("diffuse signal", layout.shape(3))
        if features.specular_signal:
            self.specular = device.zeros("specular signal", layout.shape(3))
        if features.specular_signal and finds_hit:
            self.hit = device.zeros("specular hit distance", layout.shape(1))
        super().__init__(
            device,
            guide,
            features,
            kernel,
            defines,
            name="object",
            rays=features.settings.trace.object_rays,
            planes={"diffuse": self.diffuse, "specular": self.specular, "hit_distance": self.hit},
            **own,
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        albedo: cla.Array,
        history: cla.Array,
    ) -> None:
        """`history` is the `Temporal.length` of the signals; some send all rays in every frame."""
        self._launch("trace virtual", world, mask, view, albedo=albedo, history=history)


class TraceVirtual(VirtualTracer):
    """Rays that meet real surfaces and objects."""

    def __init__(self, device: ComputeDevice, guide: Guide, features: Features) -> None:
        equirect = guide.layout.equirect and features.traced_layers
        defines = guide.defines(VIEW_EQUIRECT=equirect, **features.gloss_defines())
        super().__init__(
            device, guide, features, "trace/trace_virtual", defines, jitter=int(features.jitter)
        )


class GlossTracer(_Tracer):
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
        kernel: str,
        defines: Mapping[str, Define],
        *,
        name: str | None,
    ) -> None:
        """Ids of `guide` are indices of the real materials + 1."""
        self.change = device.zeros("gloss signal", guide.layout.shape(3))
        rays, planes = features.settings.trace.rays, {"change": self.change}
        super().__init__(
            device, guide, features, kernel, defines, name=name, rays=rays, planes=planes
        )

    def run(self, world: World, mask: Mask, view: cla.Array) -> None:
        self._launch("trace gloss", world, mask, view)


class TraceGloss(GlossTracer):
    """Rays of the specular lobe."""

    def __init__(self, device: ComputeDevice, guide: Guide, features: Features) -> None:
        equirect = guide.layout.equirect and features.traced_layers
        defines = guide.defines(VIEW_EQUIRECT=equirect, **features.gloss_defines())
        super().__init__(device, guide, features, "trace/trace_gloss", defines, name="gloss")
