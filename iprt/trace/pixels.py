"""Pixels of a view: real surfaces to relight, virtual surfaces, and glossy real surfaces."""

from __future__ import annotations

from typing import Any

import pyopencl.array as cla

from iprt.compositing.object_layer import VisibleSurfaces
from iprt.compositing.real_layer import RealLayer
from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask
from iprt.filter.signal_filter import Samples, SignalFilter
from iprt.filter.signals import Kind, Signal
from iprt.filter.temporal import Accumulated
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.passes import Clock, Pass
from iprt.settings.features import Features
from iprt.trace.carried_motion import CarriedMotion
from iprt.trace.reflection_motion import ReflectionMotion
from iprt.trace.relight import Relight
from iprt.trace.seen_through import SeenThrough
from iprt.trace.tracer_arguments import KnownArgs, SurfacesArgs
from iprt.trace.tracers import (
    GlossTracer,
    RayKernel,
    RayKernels,
    RealTracer,
    VirtualTracer,
)
from iprt.world.world import World

EVERYWHERE = -1.0
"""Least solid angle with which objects matter at all surfaces, also where they are out of sight:
real surfaces pass the light of lamps on."""


def listed_arguments(guide: Guide, mask: Mask) -> dict[str, Any]:
    """Return the pixels that a mask lists, as arguments of `IrradianceCache.run`."""
    listed = {"list": mask.traced, "count": mask.count, "touched": mask.touched}
    return {**guide.arguments(), **listed}


class RealPixels:
    """Relighting of the real surfaces of a picture (IPRT Algorithm 1, lines 1-9).

    Attributes
    ----------
    layer : RealLayer
        G-buffer of the real surfaces, without the objects.
    guide : Guide
    mask : Mask
    relight : Relight
        Holds the relighting ratio.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layer: RealLayer,
        guide: Guide,
        features: Features,
        kernel: RayKernel,
        *,
        name: str,
        min_solid_angle: float = 0.0,
    ) -> None:
        """Build the mask, tracer and filter of the pixels.

        Parameters
        ----------
        min_solid_angle : float
            Objects that subtend a smaller solid angle at a surface, in sr, may be ignored there,
            unless they emit light.
        """
        settings = features.settings
        self._features = features
        self.layer = layer
        self._min_solid_angle = EVERYWHERE if features.added_light else min_solid_angle
        self.guide = guide
        self.mask = Mask(device, guide, settings.mask, name=name, graded=features.delta)
        self._trace = RealTracer(device, guide, features, kernel, name=name)
        self._motion = layer.motion
        # E_R does not move with the objects.
        self._carry: CarriedMotion | None = None
        if features.delta:
            self._carry = CarriedMotion(device, guide, name=name)
        signal = Signal(name, "delta" if features.delta else "ratio", guide)
        self._filter = SignalFilter(
            device, [signal], settings, published=features.needs.published_filter
        )
        self.relight = Relight(
            device,
            guide,
            next(iter(self._filter.variances), None),
            delta=features.delta,
            sun=features.sun,
            added_light=features.added_light,
            clamp=settings.trace.caustic_clamp,
            name=name,
        )

    @property
    def accumulated(self) -> Accumulated | None:
        """`change` before the spatial filter; None before the first frame."""
        return self._filter.accumulated[0] if self._filter.accumulated else None

    @property
    def samples(self) -> cla.Array:
        """`RealTracer.signal`, with values at the pixels traced in this frame."""
        return self._trace.signal

    @property
    def change(self) -> cla.Array | None:
        """`RealTracer.signal` (6 planes), filtered; None before the first frame."""
        return self._filter.filtered[0] if self._filter.filtered else None

    def start(self, context: FrameContext) -> cla.Array | None:
        """Begin a frame and return the history of `mask` for `Masks.run`; None without one."""
        self._filter.start(context)
        known = self._filter.known(context) if self._features.delta else None
        return known[0] if known else None

    def passes(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes that relight the pixels of `mask`, and fill the ratio of all pixels."""
        mask, cache, panorama = self.mask, world.irradiance, world.panorama
        least, carry = self._min_solid_angle, self._carry

        def refine(context: FrameContext) -> None:
            assert cache is not None
            cache.run(
                world.arguments(self._features, context.view, captured=True),
                world.objects.device_bounds,
                listed_arguments(self.guide, mask),
                min_solid_angle=least,
            )

        def trace(context: FrameContext) -> None:
            color = self.layer.diffuse
            self._trace.run(world, mask, context.view, cache, color=color, min_solid_angle=least)

        def move(context: FrameContext) -> None:
            assert carry is not None
            self._motion = carry.run(self.layer.motion, world.objects, context)

        def relight(_: FrameContext) -> None:
            assert self.change is not None
            self.relight.run(self.change, self.layer.diffuse, world, cache, mask.touched)

        passes = []
        met = ("traced pixels", "hierarchy", "surfaces", "radiated", "lights")
        if cache is not None:
            passes.append(Pass("irradiance", Clock.FRAME, refine, (*met, "cells"), ("cells",)))
        samples = ("real samples",)
        passes.append(Pass("trace real", Clock.FRAME, trace, (*met, "cells"), samples))
        if carry is not None:
            of = ("real layer", "hierarchy")
            passes.append(Pass("shadow motion", Clock.FRAME, move, of, ("real motion",)))
        passes += self._filter.passes("real", self._samples, lambda: panorama.mean_radiance)
        lit = ("real light", "cells", "real layer")
        passes.append(Pass("relight", Clock.FRAME, relight, lit, ("ratio",)))
        return passes

    def _samples(self) -> list[Samples]:
        return [Samples(self._trace.signal, self.mask, self._motion)]


class ReflectingPixels:
    """Reflected light of visible virtual surfaces and of glossy real ones.

    Virtual surfaces follow IPRT Algorithm 1, lines 10-16. On glossy real surfaces, the objects'
    change of the reflection is traced.

    Attributes
    ----------
    mask : Mask
        Pixels of virtual surfaces.
    gloss_mask : Mask or None
        Pixels of glossy real surfaces; None without any.
    tracer : VirtualTracer
    """

    def __init__(
        self,
        device: ComputeDevice,
        real: RealLayer,
        visible: VisibleSurfaces,
        guide: Guide,
        gloss_guide: Guide | None,
        features: Features,
        kernels: RayKernels,
    ) -> None:
        """Build the masks, tracers and filter of the pixels.

        Parameters
        ----------
        gloss_guide : Guide or None
            Its ids are indices of real materials + 1.
        """
        settings, published = features.settings, features.needs.published_filter
        self._real, self._visible = real, visible
        # Eq. 3 measures the similarity of diffuse pixels; reflections differ from pixel to pixel.
        sparse = settings.mask.sparse and not features.specular_signal
        mask_settings = settings.mask.model_copy(update={"sparse": sparse})
        self.mask = Mask(device, guide, mask_settings, name="object")
        self.tracer = VirtualTracer(device, guide, features, kernels.virtual)
        self.gloss_mask: Mask | None = None
        self._signals = []
        if gloss_guide is not None:
            self.gloss_mask = Mask(device, gloss_guide, settings.mask, name="gloss")
            self._trace_gloss = GlossTracer(device, gloss_guide, features, kernels.gloss)
            self._gloss_motion = real.motion
            self._carry = CarriedMotion(device, gloss_guide, name="gloss")
            self._signals.append(Signal("gloss", "specular", gloss_guide, signed=True))
        kinds: list[Kind] = ["specular"] if features.specular_signal else []
        kinds += ["diffuse"] if features.diffuse_signal else []
        self._signals += [Signal(kind, kind, guide) for kind in kinds]
        self._filter = SignalFilter(device, self._signals, settings, published=published)
        self._published = published
        # Without hit distances, reflections move with the surface.
        moving = self.tracer.hit is not None and not published
        self._reflections: ReflectionMotion | None = None
        self._seen_through: SeenThrough | None = None
        if moving:
            self._reflections = ReflectionMotion(device, guide, glass=features.refracts)
        if moving and features.refracts:
            self._seen_through = SeenThrough(device, guide, features)
        self._reflected_motion = visible.motion

    @property
    def hit(self) -> cla.Array | None:
        """`VirtualTracer.hit`."""
        return self.tracer.hit

    @property
    def gloss_samples(self) -> cla.Array:
        """`GlossTracer.change`, with values at the pixels traced in this frame."""
        return self._trace_gloss.change

    @property
    def accumulated(self) -> list[Accumulated]:
        """Each signal of objects before the spatial filter; none before the first frame."""
        return self._filter.accumulated[0 if self.gloss_mask is None else 1 :]

    def filtered(self, signal: str) -> cla.Array | None:
        """Return a signal's filtered planes; None before the first frame, or without such one."""
        names = [one.name for one in self._signals]
        planes = dict(zip(names, self._filter.filtered, strict=False))
        return planes.get(signal)

    def start(self, context: FrameContext) -> list[cla.Array | None]:
        """Begin a frame and return the histories of `gloss_mask`, if any, and of `mask`."""
        self._filter.start(context)
        if self.gloss_mask is None:
            return [None]
        known = self._filter.known(context)
        return [known[0] if known else None, None]

    def passes(self, world: World) -> list[Pass[FrameContext]]:
        """Return the passes that shade the pixels of both masks; they reflect `world.relit`."""
        panorama = world.panorama
        met = ("traced pixels", "hierarchy", "surfaces", "radiated", "lights", "ratio")
        passes = []

        def trace_gloss(context: FrameContext) -> None:
            assert self.gloss_mask is not None
            angle = context.camera.pixel_angle
            self._trace_gloss.run(world, self.gloss_mask, context.view, pixel_angle=angle)

        def move_gloss(context: FrameContext) -> None:
            self._gloss_motion = self._carry.run(self._real.motion, world.objects, context)

        def trace(context: FrameContext) -> None:
            known = self._known(panorama.mean_radiance, context.reflected_fading)
            self.tracer.run(
                world,
                self.mask,
                context.view,
                self._surfaces(),
                known,
                steady=context.steady,
                pixel_angle=context.camera.pixel_angle,
            )

        def move_reflections(context: FrameContext) -> None:
            seen, through = self._visible, self._seen_through
            self._reflected_motion = seen.motion
            # A pure rotation of the view moves a surface and its images alike.
            if context.changed and self._reflections is not None:
                rays = None
                if through is not None:
                    through.run(world, self._surfaces(), context.view, context.index)
                    rays = through.current, through.previous
                self._reflected_motion = self._reflections.run(
                    seen.motion, seen.roughness, self.tracer.hit, context.previous, rays
                )

        samples = ("reflected samples",)
        if self.gloss_mask is not None:
            passes.append(Pass("trace gloss", Clock.FRAME, trace_gloss, met, samples))
            of = ("real layer", "hierarchy")
            passes.append(Pass("gloss motion", Clock.FRAME, move_gloss, of, ("gloss motion",)))
        passes.append(Pass("trace virtual", Clock.FRAME, trace, met, samples))
        if self._reflections is not None:
            moved = ("reflected motion",)
            of = (*samples, "object layer")
            passes.append(Pass("reflection motion", Clock.FRAME, move_reflections, of, moved))
        passes += self._filter.passes("reflected", self._samples, lambda: panorama.mean_radiance)
        return passes

    def _known(self, mean_radiance: float, fading: float) -> KnownArgs:
        histories = dict(zip((one.name for one in self._signals), self._filter.means, strict=True))
        return KnownArgs(
            certainty=self._filter.histories[-1],
            specular=histories.get("specular"),
            diffuse=histories.get("diffuse"),
            mean_radiance=mean_radiance,
            fading=0.0 if self._published else fading,
        )

    def _surfaces(self) -> SurfacesArgs:
        seen = self._visible
        return SurfacesArgs(
            albedo=seen.albedo,
            metallic=seen.metallic,
            roughness=seen.roughness,
            coat_normal=seen.coat_normal,
            variant=seen.variant,
        )

    def _samples(self) -> list[Samples]:
        """Return the samples of each signal."""
        seen, trace, real = self._visible, self.tracer, self._real
        found = []
        if self.gloss_mask is not None:
            change, mask = self._trace_gloss.change, self.gloss_mask
            found.append(Samples(change, mask, self._gloss_motion, real.roughness))
        if trace.specular is not None:
            motion = self._reflected_motion
            found.append(Samples(trace.specular, self.mask, motion, seen.roughness))
        if trace.diffuse is not None:
            found.append(Samples(trace.diffuse, self.mask, seen.motion))
        return found
