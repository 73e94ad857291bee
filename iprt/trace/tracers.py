"""Tracers of irradiance at real surfaces and of light reflected by virtual ones.

They implement IPRT Algorithm 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.filter.mask import Mask
from iprt.gbuffer.guide import Guide
from iprt.settings.features import Features
from iprt.trace.tracer_arguments import JitterArgs, KnownArgs, PixelsArgs, SurfacesArgs
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World


@dataclass(frozen=True)
class RayKernel:
    """Kernel that sends rays, cones or paths from listed pixels, and the scene that they meet.

    Attributes
    ----------
    file : str
        File of `cl/` without its suffix. The kernel has the file's name.
    defines : mapping
        Its variant, besides the layout of the pixels.
    scene : callable
        Returns the arguments by parameter, given the world and the view's constants.
    fixed : mapping
        Further arguments.
    finds_hit : bool
        It computes the distance of reflected surfaces.
    """

    file: str
    defines: Mapping[str, Define]
    scene: Callable[[World, cla.Array], Mapping[str, Any]]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    finds_hit: bool = True


@dataclass(frozen=True)
class RayKernels:
    """Kernels of the three kinds of pixels.

    Attributes
    ----------
    real, virtual, gloss : RayKernel
        For real surfaces to relight, virtual surfaces, and glossy real surfaces.
    """

    real: RayKernel
    virtual: RayKernel
    gloss: RayKernel

    @classmethod
    def of(cls, features: Features) -> Self:
        """Return the kernels of IPRT's rays (Algorithm 1)."""

        def scene(world: World, view: cla.Array) -> dict[str, Any]:
            return {"world": world.arguments(features, view)}

        real = "trace/trace_delta" if features.delta else "trace/trace_real"
        gloss = features.gloss_defines()
        passes_on = features.delta and features.added_light
        return cls(
            RayKernel(real, features.trace_defines() | {"RELIT": passes_on}, scene),
            RayKernel("trace/trace_virtual", gloss, scene),
            RayKernel("trace/trace_gloss", gloss, scene),
        )


class _Tracer:
    """Pass that traces the listed pixels of a guide's layer.

    Attributes
    ----------
    samples : 1 plane uint32
        Number of each pixel's rays since the start.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        kernel: RayKernel,
        *,
        name: str,
        rays: int,
        planes: Mapping[str, cla.Array | None],
        defines: Mapping[str, Define],
    ) -> None:
        """Build the kernel.

        Parameters
        ----------
        name : str
            Prefix of the buffer that counts each pixel's samples.
        planes : mapping
            Output planes by parameter.
        defines : mapping
            Variant of the kernel, besides its own.
        """
        self._guide, self._features, self._rays = guide, features, rays
        self._scene = kernel.scene
        layout = guide.layout
        # Rays use the view only if objects are traced as its rasterized layers.
        equirect = layout.equirect and features.traced_layers
        variant = {"VIEW_EQUIRECT": equirect, **defines, **kernel.defines}
        self.samples = device.zeros(f"{name} samples", layout.shape(1), np.uint32)
        entry, pixels = kernel.file.rpartition("/")[2], layout.width * layout.height
        self._kernel = device.kernel(f"{kernel.file}.cl", entry, variant, items=pixels).fixed(
            layout.arguments(), planes, kernel.fixed, {"samples": self.samples}
        )

    def _launch(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        color: cla.Array | None = None,
        pixel_angle: float = 0.0,
        **more: Any,
    ) -> None:
        """Run the kernel; `more` are further arguments, of which the kernel may lack some."""
        layout = self._guide.layout
        self._kernel(
            (layout.width * layout.height,),
            self._scene(world, view),
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
                color=color,
                pixel_angle=pixel_angle,
            ),
        )


class RealTracer(_Tracer):
    """Change of real surfaces' irradiance by the objects, at the traced pixels of a layer.

    Attributes
    ----------
    signal : 6 planes
        Irradiance that objects block and irradiance that they reflect or emit instead, both
        relative to E_R, rgb each. With the estimator "ratio": E_R rgb and E_RV rgb, irradiance / π.
        Valid at the traced pixels.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        kernel: RayKernel,
        *,
        name: str,
    ) -> None:
        """Build the kernel; `name` prefixes buffers."""
        self.signal = device.zeros(f"{name} signal", guide.layout.shape(6))
        rays, planes = features.settings.trace.rays, {"signal": self.signal}
        super().__init__(
            device, guide, features, kernel, name=name, rays=rays, planes=planes, defines={}
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        cache: IrradianceCache | None,
        *,
        color: cla.Array,
        min_solid_angle: float,
    ) -> None:
        """Trace the pixels of `mask`.

        Parameters
        ----------
        color : 3 planes
            Radiance of the layer.
        cache : IrradianceCache or None
            E_R, if the signal is relative to it.
        min_solid_angle : float
            Objects that subtend a smaller solid angle at a surface, in sr, may be ignored there.
        """
        known: dict[str, Any] = {} if cache is None else {"cache": cache.arguments(world.panorama)}
        self._launch(world, mask, view, color, min_solid_angle=min_solid_angle, **known)


class VirtualTracer(_Tracer):
    """Light that visible virtual surfaces reflect, at the traced pixels.

    Attributes
    ----------
    diffuse : 3 planes or None
        Irradiance / π, without albedo; None if no material has a diffuse lobe.
    specular : 3 planes or None
        Radiance; None if no material has a specular lobe.
    hit : 1 plane or None
        Mean distance of the hits of the specular lobe, metres; negative: mostly objects, 1e6: the
        sky, 0: no lobe. None if `specular` is, or if the kernel does not compute it: the filter
        then moves reflections with the surface.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        features: Features,
        kernel: RayKernel,
    ) -> None:
        """Build the kernel."""
        layout = guide.layout
        self.diffuse = self.specular = self.hit = None
        if features.diffuse_signal:
            self.diffuse = device.zeros("diffuse signal", layout.shape(3))
        if features.specular_signal:
            self.specular = device.zeros("specular signal", layout.shape(3))
        if features.specular_signal and kernel.finds_hit:
            self.hit = device.zeros("specular hit distance", layout.shape(1))
        super().__init__(
            device,
            guide,
            features,
            kernel,
            name="object",
            rays=features.settings.trace.object_rays,
            planes={"diffuse": self.diffuse, "specular": self.specular, "hit_distance": self.hit},
            defines=guide.defines(),
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        surfaces: SurfacesArgs,
        known: KnownArgs,
        *,
        steady: bool,
        pixel_angle: float,
    ) -> None:
        """Trace the pixels of `mask`. Cones and paths ignore `known` and `steady`.

        Parameters
        ----------
        surfaces : SurfacesArgs
        known : KnownArgs
        steady : bool
            Nothing moves, or there is no history: rays of metals may start all over a pixel too.
            In motion that would blur their reflections, which are resampled in each frame.
        pixel_angle : float
            `View.pixel_angle`.
        """
        jitters = self._features.jitter
        jitter = JitterArgs(metals=int(jitters and steady), others=int(jitters), view=view)
        seen = {"surfaces": surfaces, "known": known, "jitter": jitter}
        self._launch(world, mask, view, pixel_angle=pixel_angle, **seen)


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
        kernel: RayKernel,
    ) -> None:
        """Build the kernel; ids of `guide` are indices of real materials + 1."""
        self.change = device.zeros("gloss signal", guide.layout.shape(3))
        super().__init__(
            device,
            guide,
            features,
            kernel,
            name="gloss",
            rays=features.settings.trace.rays,
            planes={"change": self.change},
            defines=guide.defines(),
        )

    def run(self, world: World, mask: Mask, view: cla.Array, *, pixel_angle: float) -> None:
        """Trace the pixels of `mask`; `pixel_angle` is `View.pixel_angle`."""
        self._launch(world, mask, view, pixel_angle=pixel_angle)
