"""Tracers of irradiance at real surfaces and of light reflected by virtual ones.

They implement IPRT Algorithm 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.block import Block, Floats, Int32, Ints, when
from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.filter.mask import Mask
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.settings.features import Features
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World


@dataclass(kw_only=True)
class PixelsArgs(Block):
    """Listed pixels of a layer to trace (`cl/lib/trace/traced.h`).

    Attributes
    ----------
    width, height : int
    rays : int
        Rays per pixel.
    frame_seed : int
    list : (width * height,) int32
        y * width + x.
    count : (1,) int32
        Length of the list.
    guide : 7 planes
    """

    width: Int32
    height: Int32
    rays: Int32
    frame_seed: Int32
    list: Ints
    count: Ints
    guide: Floats


@dataclass(kw_only=True)
class JitterArgs(Block):
    """Random positions in their pixel at which rays start.

    Attributes
    ----------
    on : int
        1: rays start there; 0: at the pixel's centre.
    view : (16,) float32
        `View.kernel_constants()`.
    """

    on: Int32 = when("OBJECTS_BVH")
    view: Floats = when("OBJECTS_BVH")


class _Tracer:
    """Kernel that traces rays or cones from the listed pixels of a guide's layer."""

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
        """Build the kernel.

        Parameters
        ----------
        kernel : str
            File of `cl/` without its suffix. The kernel has the file's name.
        name : str or None
            Prefix of the buffer that counts each pixel's samples; None: the kernel draws none.
        planes : mapping
            Output planes by parameter.
        **own
            Parameters of this kernel alone.
        """
        self._guide, self._features, self._rays = guide, features, rays
        layout = guide.layout
        if name is not None:
            own["samples"] = device.zeros(f"{name} samples", layout.shape(1), np.uint32)
        pixels = layout.width * layout.height
        entry = kernel.rpartition("/")[2]
        self._kernel = device.kernel(f"{kernel}.cl", entry, defines, items=pixels).fixed(
            layout.arguments(), planes, **own
        )

    def arguments(self, world: World, view: cla.Array) -> dict[str, Any]:
        """Return the scene that rays are traced through, by kernel parameter."""
        return {"world": world.arguments(self._features, view)}

    def _launch(self, world: World, mask: Mask, view: cla.Array, **more: Any) -> None:
        """Run the kernel; `more` are further arguments, of which the kernel may lack some."""
        layout = self._guide.layout
        self._kernel(
            (layout.width * layout.height,),
            self.arguments(world, view),
            more,
            {"touched": mask.touched},
            pixels=PixelsArgs(
                width=layout.width,
                height=layout.height,
                rays=self._rays,
                frame_seed=self._features.settings.seed,
                list=mask.traced,
                count=mask.count,
                guide=self._guide.current,
            ),
        )


class RealTracer(_Tracer):
    """Change of real surfaces' irradiance by the objects, at the traced pixels of a layer.

    Attributes
    ----------
    signal : 6 planes
        Irradiance that objects block and irradiance that they reflect or emit instead, both
        relative to E_R, rgb each. Valid at the traced pixels.
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
        """Build the kernel; `own` are parameters of this kernel alone."""
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
        """Trace the pixels of `mask`.

        Parameters
        ----------
        cache : IrradianceCache or None
            E_R, if the signal is relative to it.
        min_solid_angle : float
            Objects that subtend a smaller solid angle at a surface, in sr, may be ignored there.
        """
        known = {} if cache is None else {"cache": cache.arguments(world.panorama)}
        self._launch(world, mask, view, min_solid_angle=min_solid_angle, **known)


class TraceReal(RealTracer):
    """Rays from real surfaces, for the estimator "delta" or "ratio".

    With "ratio", `signal` is E_R rgb and E_RV rgb, irradiance / π, and no cache is needed.
    """

    def __init__(
        self, device: ComputeDevice, guide: Guide, features: Features, *, name: str
    ) -> None:
        # Rays use the view only if objects are traced as its rasterized layers.
        equirect = guide.layout.equirect and features.traced_layers
        defines = plane_defines(equirect=equirect, **features.trace_defines())
        kernel = "trace/trace_delta" if features.delta else "trace/trace_real"
        super().__init__(device, guide, features, kernel, defines, name=name)


class VirtualTracer(_Tracer):
    """Light that visible virtual surfaces reflect, at the traced pixels.

    Attributes
    ----------
    diffuse : 3 planes or None
        Irradiance / π, without albedo; None if no material has a diffuse lobe.
    specular : 3 planes or None
        Radiance; None if no material has a specular lobe.
    hit : 1 plane or None
        Mean distance of the hits of the specular lobe, metres; 1e6: the sky, 0: no lobe. None if
        `specular` is, or if the kernel does not compute it: the filter then moves reflections with
        the surface.
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
        """Build the kernel; `own` are parameters of this kernel alone."""
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
        """Trace the pixels of `mask`.

        Parameters
        ----------
        albedo : 3 planes
        history : 1 plane
            `Temporal.length` of the signals. Only rays need it; cones and paths ignore it.
        """
        self._launch(world, mask, view, albedo=albedo, history=history)


class TraceVirtual(VirtualTracer):
    """Rays from virtual surfaces."""

    def __init__(self, device: ComputeDevice, guide: Guide, features: Features) -> None:
        equirect = guide.layout.equirect and features.traced_layers
        defines = guide.defines(VIEW_EQUIRECT=equirect, **features.gloss_defines())
        super().__init__(device, guide, features, "trace/trace_virtual", defines)

    def arguments(self, world: World, view: cla.Array) -> dict[str, Any]:
        """Return the scene and the start of rays, by kernel parameter."""
        jitter = JitterArgs(on=int(self._features.jitter), view=view)
        return super().arguments(world, view) | {"jitter": jitter}


class GlossTracer(_Tracer):
    """Change of the reflections of glossy real surfaces by the objects, at the traced pixels.

    Attributes
    ----------
    change : 3 planes
        Radiance of either sign, valid at the traced pixels: reflected objects minus the surfaces
        behind them.
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
        """Build the kernel; ids of `guide` are indices of real materials + 1."""
        self.change = device.zeros("gloss signal", guide.layout.shape(3))
        rays, planes = features.settings.trace.rays, {"change": self.change}
        super().__init__(
            device, guide, features, kernel, defines, name=name, rays=rays, planes=planes
        )

    def run(self, world: World, mask: Mask, view: cla.Array) -> None:
        """Trace the pixels of `mask`."""
        self._launch(world, mask, view)


class TraceGloss(GlossTracer):
    """Rays of the specular lobe of glossy real surfaces."""

    def __init__(self, device: ComputeDevice, guide: Guide, features: Features) -> None:
        equirect = guide.layout.equirect and features.traced_layers
        defines = guide.defines(VIEW_EQUIRECT=equirect, **features.gloss_defines())
        super().__init__(device, guide, features, "trace/trace_gloss", defines, name="gloss")
