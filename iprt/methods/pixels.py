"""The two kinds of pixels of a view: real surfaces that are relit, virtual ones that are shaded."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask, grid_offset
from iprt.filter.signal_filter import SignalFilter
from iprt.filter.temporal import Accumulated, Kind
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.gbuffer.layout import PlaneLayout
from iprt.methods.reflection_motion import ReflectionMotion
from iprt.methods.relight import Relight
from iprt.methods.trace import TraceReal, TraceVirtual
from iprt.settings.features import Features
from iprt.view.real_layer import RealLayer
from iprt.world.objects.object_layers import VisibleLayer
from iprt.world.world import World


class RealPixels:
    """What objects do to the real surfaces of a picture: Algorithm 1, lines 1-9.

    Attributes
    ----------
    layer : RealLayer
        The picture without objects.
    mask : Mask
    relight : Relight
        Holds the ratio.
    change : 6 planes or None
        `TraceReal.signal`, filtered, after the first frame.
    accumulated : Accumulated or None
        The same before the spatial filter.
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
    ) -> None:
        """Objects that span less than `min_solid_angle` sr from a surface may be ignored."""
        settings = features.settings
        self._features = features
        self.layer = layer
        self._min_solid_angle = min_solid_angle
        self._guide = guide
        self.mask = Mask(device, guide, settings.mask, name=name, graded=features.delta)
        self._trace = TraceReal(device, guide, features, name=name)
        kind: Kind = "delta" if features.delta else "ratio"
        self._filter = SignalFilter(
            device, guide, kind, settings, name=name, published=features.needs.published_filter
        )
        self.relight = Relight(device, guide, delta=features.delta, name=name)
        self.change: cla.Array | None = None

    @property
    def accumulated(self) -> Accumulated | None:
        return self._filter.accumulated

    def run(self, world: World, context: FrameContext) -> cla.Array:
        """Relight the frame's real pixels and return the ratio per pixel."""
        layer, mask, cache = self.layer, self.mask, world.irradiance
        self._filter.start(context)
        mask.run(grid_offset(context.index), layer.motion, metre=world.panorama.scale)
        if cache is not None:
            cache.run(
                world.arguments(self._features),
                self._guide,
                mask,
                context.view,
                min_solid_angle=self._min_solid_angle,
            )
        self._trace.run(world, mask, context.view, cache, min_solid_angle=self._min_solid_angle)
        self.change = self._filter.run(self._trace.signal, mask, layer.motion, context)
        self.relight.run(self.change, layer.diffuse, world, cache, mask.touched)
        return self.relight.ratio


class VirtualPixels:
    """Light that visible virtual surfaces reflect: Algorithm 1, lines 10-16.

    Attributes
    ----------
    reflected : dict of {"diffuse", "specular"} to 3 planes
        Filtered, after the first frame.
    hit : 1 plane or None
        See `TraceVirtual`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        visible: VisibleLayer,
        layout: PlaneLayout,
        features: Features,
        *,
        equirect: bool,
        camera: cla.Array | None = None,
    ) -> None:
        """Pixels of `visible`; `camera`: `CameraMotion.rows`, where the camera moves."""
        settings, published = features.settings, features.needs.published_filter
        self._visible = visible
        self._guide = Guide(device, layout, equirect=equirect, name="object", camera=camera)
        # Eq. 3 measures how alike diffuse pixels are; reflections differ from pixel to pixel.
        sparse = settings.mask.sparse and not features.specular_signal
        mask_settings = settings.mask.model_copy(update={"sparse": sparse})
        self._mask = Mask(device, self._guide, mask_settings, name="object")
        self._trace = TraceVirtual(device, self._guide, features)
        kinds: list[Kind] = ["diffuse"] if features.diffuse_signal else []
        kinds += ["specular"] if features.specular_signal else []
        self._filters = {
            kind: SignalFilter(device, self._guide, kind, settings, name=kind, published=published)
            for kind in kinds
        }
        self._reflections = (
            ReflectionMotion(device, self._guide)
            if features.specular_signal and not published
            else None
        )
        self.reflected: dict[Kind, cla.Array] = {}

    @property
    def hit(self) -> cla.Array | None:
        return self._trace.hit

    @property
    def accumulated(self) -> tuple[Accumulated, ...]:
        """Each signal before the spatial filter; empty before the first frame."""
        found = (signal_filter.accumulated for signal_filter in self._filters.values())
        return tuple(signal for signal in found if signal is not None)

    def run(self, world: World, context: FrameContext) -> None:
        """Shade the frame's virtual pixels; `world.relit` is what they reflect."""
        seen, trace = self._visible, self._trace
        for signal_filter in self._filters.values():
            signal_filter.start(context)
        self._guide.run(context.view, seen.normal, seen.depth, seen.id)
        self._mask.run(grid_offset(context.index), seen.motion, metre=world.panorama.scale)
        history = next(iter(self._filters.values())).history
        trace.run(world, self._mask, context.view, seen.albedo, history)
        signals = {"diffuse": trace.diffuse, "specular": trace.specular}
        for kind, signal_filter in self._filters.items():
            motion = seen.motion
            # A head that turns sees surface and reflection in one direction: they move alike.
            if kind == "specular" and context.changed and self._reflections is not None:
                motion = self._reflections.run(motion, seen.roughness, trace.hit, context.previous)
            self.reflected[kind] = signal_filter.run(
                signals[kind],
                self._mask,
                motion,
                context,
                roughness=seen.roughness if kind == "specular" else None,
                rect=seen.rect,
            )
