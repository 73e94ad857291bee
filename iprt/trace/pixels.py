"""The two kinds of pixels of a view: real surfaces that are relit, and those that reflect objects
or are objects.
"""

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
    """Real surfaces of a picture, relit: Algorithm 1, lines 1-9.

    Attributes
    ----------
    layer : RealLayer
        The picture without objects.
    guide : Guide
    mask : Mask
    relight : Relight
        Holds the ratio.
    change : 6 planes or None
        `TraceReal.signal`, filtered, after the first frame.
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
        """Objects that span less than `min_solid_angle` sr from a surface may be ignored.

        `tracer`: what traces the pixels, called as `TraceReal` is.
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
        """What `Masks.run` is given."""
        known = self._filter.known(context) if self._features.delta else None
        return known[0] if known else None

    def run(self, world: World, context: FrameContext) -> cla.Array:
        """Relight the pixels of `mask` and return the ratio of all."""
        layer, mask, cache = self.layer, self.mask, world.irradiance
        self._filter.start(context)
        if cache is not None:
            cache.run(
                world.arguments(self._features),
                self.guide,
                mask,
                context.view,
                min_solid_angle=self._min_solid_angle,
            )
        self._trace.run(world, mask, context.view, cache, min_solid_angle=self._min_solid_angle)
        samples = Samples(self._trace.signal, mask, layer.motion)
        radiance = world.panorama.mean_radiance
        (self.change,) = self._filter.run([samples], context, radiance=radiance)
        self.relight.run(self.change, layer.diffuse, world, cache, mask.touched)
        return self.relight.ratio


class ReflectingPixels:
    """Light that visible virtual surfaces reflect (Algorithm 1, lines 10-16), and what objects
    change in the reflections of glossy real ones.

    Attributes
    ----------
    mask : Mask
        Of virtual surfaces.
    gloss_mask : Mask or None
        Of glossy real surfaces, where there are any.
    diffuse, specular : 3 planes or None
        What objects reflect, filtered, after the first frame.
    change : 3 planes or None
        Radiance to add to what the camera saw of real surfaces, of either sign, likewise.
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
        """Ids of `gloss_guide` are indices of real materials + 1.

        `tracer`, `gloss_tracer`: what traces virtual surfaces and glossy real ones, called as
        `TraceVirtual` and `TraceGloss` are.
        """
        settings, published = features.settings, features.needs.published_filter
        self._real, self._visible = real, visible
        # Eq. 3 measures how alike diffuse pixels are; reflections differ from pixel to pixel.
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
        # Tracers that do not know how far away reflections are have them taken as painted on.
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
        """What `Masks.run` is given for `gloss_mask`."""
        known = self._filter.known(context)
        return known[0] if known else None

    def run(self, world: World, context: FrameContext) -> None:
        """Shade the pixels of both masks; `world.relit` is what they reflect."""
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
        """Samples of what objects reflect."""
        seen, trace, mask = self._visible, self._trace, self.mask
        # All signals of objects have had the same rays.
        trace.run(world, mask, context.view, seen.albedo, self._filter.histories[-1])
        found = {}
        if trace.diffuse is not None:
            found["diffuse"] = Samples(trace.diffuse, mask, seen.motion)
        if trace.specular is not None:
            motion = seen.motion
            # A head that turns sees surface and reflection in one direction: they move alike.
            if context.changed and self._reflections is not None:
                motion = self._reflections.run(motion, seen.roughness, trace.hit, context.previous)
            found["specular"] = Samples(trace.specular, mask, motion, roughness=seen.roughness)
        return found
