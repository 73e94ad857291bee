"""Pixels of a view: real surfaces to relight, virtual surfaces, and glossy real surfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask
from iprt.filter.signal_filter import Samples, SignalFilter
from iprt.filter.signals import Kind, Signal
from iprt.filter.temporal import Accumulated
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.settings.features import Features
from iprt.trace.reflection_motion import ReflectionMotion
from iprt.trace.relight import Relight
from iprt.trace.tracers import TraceGloss, TraceReal, TraceVirtual
from iprt.view.real_layer import RealLayer
from iprt.world.objects.object_layers import VisibleSurfaces
from iprt.world.world import World


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
    change : 6 planes or None
        `TraceReal.signal`, filtered; None before the first frame.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layer: RealLayer,
        guide: Guide,
        features: Features,
        *,
        name: str,
        min_solid_angle: float = 0.0,
        tracer: Callable[..., Any] = TraceReal,
    ) -> None:
        """Build the mask, tracer and filter of the pixels.

        Parameters
        ----------
        min_solid_angle : float
            Objects that subtend a smaller solid angle at a surface, in sr, may be ignored there.
        tracer : callable
            Builds the tracer of the pixels, with the arguments of `TraceReal`.
        """
        settings = features.settings
        self._features = features
        self.layer = layer
        self._min_solid_angle = min_solid_angle
        self.guide = guide
        self.mask = Mask(device, guide, settings.mask, name=name, graded=features.delta)
        self._trace = tracer(device, guide, features, name=name)
        signal = Signal(name, "delta" if features.delta else "ratio", guide)
        self._filter = SignalFilter(
            device, [signal], settings, published=features.needs.published_filter
        )
        self.relight = Relight(
            device,
            guide,
            self._filter.spans,
            next(iter(self._filter.variances), None),
            delta=features.delta,
            name=name,
        )
        self.change: cla.Array | None = None

    @property
    def accumulated(self) -> Accumulated | None:
        """`change` before the spatial filter; None before the first frame."""
        return self._filter.accumulated[0] if self._filter.accumulated else None

    def history(self, context: FrameContext) -> cla.Array | None:
        """Return the history of `mask` for `Masks.run`; None without one."""
        known = self._filter.known(context) if self._features.delta else None
        return known[0] if known else None

    def run(self, world: World, context: FrameContext) -> cla.Array:
        """Relight the pixels of `mask` and return the ratio of all pixels."""
        layer, mask, cache = self.layer, self.mask, world.irradiance
        self._filter.start(context)
        if cache is not None:
            cache.run(
                world.arguments(self._features, context.view, captured=True),
                world.objects.device_bounds,
                self.guide,
                mask,
                min_solid_angle=self._min_solid_angle,
            )
        self._trace.run(world, mask, context.view, cache, min_solid_angle=self._min_solid_angle)
        samples = Samples(self._trace.signal, mask, layer.motion)
        radiance = world.panorama.mean_radiance
        (self.change,) = self._filter.run([samples], context, radiance=radiance)
        self.relight.run(self.change, layer.diffuse, world, cache, mask.touched)
        return self.relight.ratio


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
    diffuse, specular : 3 planes or None
        Light that objects reflect, filtered; None before the first frame.
    change : 3 planes or None
        Radiance of either sign to add to the captured radiance of glossy real surfaces, filtered;
        None before the first frame.
    """

    def __init__(
        self,
        device: ComputeDevice,
        real: RealLayer,
        visible: VisibleSurfaces,
        guide: Guide,
        gloss_guide: Guide | None,
        features: Features,
        *,
        tracer: Callable[..., Any] = TraceVirtual,
        gloss_tracer: Callable[..., Any] = TraceGloss,
    ) -> None:
        """Build the masks, tracers and filter of the pixels.

        Parameters
        ----------
        gloss_guide : Guide or None
            Its ids are indices of real materials + 1.
        tracer, gloss_tracer : callable
            Build the tracers of virtual and of glossy real surfaces, with the arguments of
            `TraceVirtual` and `TraceGloss`.
        """
        settings, published = features.settings, features.needs.published_filter
        self._real, self._visible = real, visible
        # Eq. 3 measures the similarity of diffuse pixels; reflections differ from pixel to pixel.
        sparse = settings.mask.sparse and not features.specular_signal
        mask_settings = settings.mask.model_copy(update={"sparse": sparse})
        self.mask = Mask(device, guide, mask_settings, name="object")
        self._trace = tracer(device, guide, features)
        self.gloss_mask: Mask | None = None
        self._signals = []
        if gloss_guide is not None:
            self.gloss_mask = Mask(device, gloss_guide, settings.mask, name="gloss")
            self._trace_gloss = gloss_tracer(device, gloss_guide, features)
            self._signals.append(Signal("gloss", "specular", gloss_guide))
        kinds: list[Kind] = ["specular"] if features.specular_signal else []
        kinds += ["diffuse"] if features.diffuse_signal else []
        self._signals += [Signal(kind, kind, guide) for kind in kinds]
        self._filter = SignalFilter(device, self._signals, settings, published=published)
        # Without hit distances, reflections move with the surface.
        moving = self._trace.hit is not None and not published
        self._reflections = ReflectionMotion(device, guide) if moving else None
        self.change: cla.Array | None = None
        self.diffuse: cla.Array | None = None
        self.specular: cla.Array | None = None

    @property
    def hit(self) -> cla.Array | None:
        """`TraceVirtual.hit`."""
        return self._trace.hit

    @property
    def accumulated(self) -> list[Accumulated]:
        """Each signal of objects before the spatial filter; none before the first frame."""
        return self._filter.accumulated[0 if self.gloss_mask is None else 1 :]

    def gloss_history(self, context: FrameContext) -> cla.Array | None:
        """Return the history of `gloss_mask` for `Masks.run`; None without one."""
        known = self._filter.known(context)
        return known[0] if known else None

    def run(self, world: World, context: FrameContext) -> None:
        """Shade the pixels of both masks; they reflect `world.relit`."""
        self._filter.start(context)
        found = {}
        if self.gloss_mask is not None:
            self._trace_gloss.run(world, self.gloss_mask, context.view)
            found["gloss"] = Samples(
                self._trace_gloss.change,
                self.gloss_mask,
                self._real.motion,
                roughness=self._real.roughness,
            )
        found |= self._shade(world, context)
        frame = [found[signal.name] for signal in self._signals]
        filtered = self._filter.run(frame, context, radiance=world.panorama.mean_radiance)
        named = dict(zip((signal.name for signal in self._signals), filtered, strict=True))
        self.change = named.get("gloss")
        self.diffuse, self.specular = named.get("diffuse"), named.get("specular")

    def _shade(self, world: World, context: FrameContext) -> dict[str, Samples]:
        """Trace the virtual surfaces and return their samples by signal."""
        seen, trace, mask = self._visible, self._trace, self.mask
        # All signals of objects have the same rays, hence the same history.
        trace.run(world, mask, context.view, seen.albedo, self._filter.histories[-1])
        found = {}
        if trace.diffuse is not None:
            found["diffuse"] = Samples(trace.diffuse, mask, seen.motion)
        if trace.specular is not None:
            motion = seen.motion
            # A pure rotation of the view moves a surface and its reflection alike.
            if context.changed and self._reflections is not None:
                motion = self._reflections.run(motion, seen.roughness, trace.hit, context.previous)
            found["specular"] = Samples(trace.specular, mask, motion, roughness=seen.roughness)
        return found
