"""The two kinds of pixels of a view: real surfaces that are relit, virtual ones that are shaded."""

from __future__ import annotations

from dataclasses import replace

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.atrous import Atrous
from iprt.filter.history_fix import HistoryFix
from iprt.filter.interpolate import Interpolate
from iprt.filter.mask import Mask, grid_offset
from iprt.filter.temporal import Accumulated, Kind, Temporal, signal_planes
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.methods.reflection_motion import ReflectionMotion
from iprt.methods.relight import Relight
from iprt.methods.trace import TraceReal, TraceVirtual
from iprt.settings.features import Features
from iprt.settings.model import Settings
from iprt.view.real_layer import RealLayer
from iprt.world.objects.object_layers import VisibleLayer
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World

MAP_LEAST = 0.1
"""sr: what objects do to surfaces from which they look smaller is not worth reflecting."""

MAP_SETTLED, MAP_EVERY = 16, 4
"""After so many updates, the map of what objects do serves for so many frames if nothing moves."""


class SignalFilter:
    """Sparse samples of one signal become a clean picture: interpolate, accumulate, filter.

    Attributes
    ----------
    accumulated : Accumulated or None
        The signal before the spatial filter, after the first frame; of the published filter, after
        it.
    """

    def __init__(
        self, device: ComputeDevice, guide: Guide, kind: Kind, settings: Settings, *, name: str
    ) -> None:
        self._published = settings.temporal.history == "iprt"
        self._interpolate = Interpolate(device, guide, signal_planes(kind), settings.interpolate)
        rays = settings.trace.object_rays if kind in ("diffuse", "specular") else 1
        self._temporal = Temporal(device, guide, kind, settings.temporal, name=name, rays=rays)
        self._atrous = Atrous(
            device, guide, kind, settings.atrous, name=name, guided=not self._published
        )
        self.accumulated: Accumulated | None = None
        self._fix: HistoryFix | None = None
        enough = settings.temporal.enough
        # Reflections differ too much between far pixels.
        if enough > 0.0 and settings.atrous.levels and kind != "specular" and not self._published:
            self._fix = HistoryFix(device, guide, kind, settings.atrous, enough, name=name)

    @property
    def history(self) -> cla.Array:
        """`Temporal.length` of the signal."""
        return self._temporal.length

    def start(self, context: FrameContext) -> None:
        """Begin a frame, before its rays are sent: the history says how many; a cut ends it."""
        if context.cut:
            self._temporal.reset()

    def run(
        self,
        signal: cla.Array,
        mask: Mask,
        motion: cla.Array,
        context: FrameContext,
        *,
        roughness: cla.Array | None = None,
        rect: tuple[int, int, int, int] | None = None,
    ) -> cla.Array:
        """The filtered planes of `signal`, which holds values where `mask` had rays traced."""
        self._interpolate.run(mask.level, signal, grid_offset(context.index))
        if self._published:
            signal = self._atrous.run(signal, roughness=roughness, rect=rect)
        accumulated = self._temporal.run(
            signal, motion, mask.level, fading=context.fading, changed=context.changed
        )
        if self._fix is not None:
            accumulated = self._fix.run(accumulated, mask.level)
        self.accumulated = accumulated
        if self._published:
            return accumulated.signal
        return self._atrous.run(
            accumulated.signal, accumulated.variance, roughness=roughness, rect=rect
        )


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
        least: float = 0.0,
    ) -> None:
        """Objects that span less than `least` sr from a surface need not be taken into account."""
        settings = features.settings
        self._features = features
        self.layer = layer
        self._least = least
        self._guide = guide
        self.mask = Mask(device, guide, settings.mask, name=name, graded=features.delta)
        self._trace = TraceReal(device, guide, features, name=name)
        kind: Kind = "delta" if features.delta else "ratio"
        self._filter = SignalFilter(device, guide, kind, settings, name=name)
        self.relight = Relight(device, guide, delta=features.delta, name=name)
        self.change: cla.Array | None = None

    @property
    def accumulated(self) -> Accumulated | None:
        return self._filter.accumulated

    def run(self, world: World, cache: IrradianceCache | None, context: FrameContext) -> cla.Array:
        """Relight the frame's real pixels and return the ratio per pixel.

        `cache` holds E_R for the estimator "delta".
        """
        layer, mask = self.layer, self.mask
        self._filter.start(context)
        mask.run(grid_offset(context.index), layer.motion, metre=world.panorama.scale)
        if cache is not None:
            cache.run(
                world.arguments(self._features),
                self._guide,
                mask,
                context.view,
                least=self._least,
            )
        self._trace.run(world, mask, context.view, cache, least=self._least)
        self.change = self._filter.run(self._trace.signal, mask, layer.motion, context)
        self.relight.run(self.change, layer.diffuse, world, cache, mask.touched)
        return self.relight.ratio


class RatioMap:
    """What objects do to all real surfaces around the capture centre, coarsely.

    Virtual surfaces reflect real ones relit by it where the view does not show these.

    Attributes
    ----------
    rows : int
        Rows of an equirect grid with twice as many columns.
    ratio : (2 * rows * rows, 4) float32
    """

    def __init__(
        self, device: ComputeDevice, features: Features, camera: cla.Array | None = None
    ) -> None:
        """`camera`: `CameraMotion.rows`, where the camera moves."""
        self.rows = features.settings.trace.ratio_rows
        self._device = device
        self._view = View(2 * self.rows, self.rows, projection="equirect")
        layout = PlaneLayout(self._view.width, self._view.height)
        self._constants = device.upload("ratio map view", self._view.kernel_constants())
        layer = RealLayer(
            device, layout, equirect=True, name="ratio map", radiated=True, camera=camera
        )
        self._guide = Guide(device, layout, equirect=True, name="ratio map", camera=camera)
        self._pixels = RealPixels(
            device, layer, self._guide, features, name="ratio map", least=MAP_LEAST
        )
        self.ratio = self._pixels.relight.ratio
        self._updates = 0
        self._follows_camera = camera is not None
        self._in_motion = False

    def run(self, world: World, cache: IrradianceCache | None, context: FrameContext) -> None:
        """Follow the frame; `context.view` is not used, the map does not turn."""
        # A map that has settled gains little from a frame more.
        settled = self._updates >= MAP_SETTLED and not context.changed
        if settled and context.index % MAP_EVERY > 0:
            return
        here = replace(context, index=self._updates, view=self._constants, previous=self._constants)
        self._updates += 1
        with self._device.profile.section("ratio map"):
            # What a camera's motion moved stands still in the frame after.
            if here.index == 0 or context.changed or self._in_motion:
                self._pixels.layer.run(world.panorama, self._constants, self._constants)
            self._in_motion = self._follows_camera and context.changed
            layer = self._pixels.layer
            self._guide.run(self._constants, layer.normal, layer.depth, layer.id)
            self._pixels.run(world, cache, here)


class VirtualPixels:
    """Light that visible virtual surfaces reflect: Algorithm 1, lines 10-16.

    Attributes
    ----------
    visible : VisibleLayer
    reflected : dict of {"diffuse", "specular"} to 3 planes
        Filtered, after the first frame.
    hit : 1 plane or None
        See `TraceVirtual`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        features: Features,
        *,
        equirect: bool,
        camera: cla.Array | None = None,
    ) -> None:
        """`camera`: `CameraMotion.rows`, where the camera moves."""
        settings = features.settings
        self.visible = VisibleLayer(device, layout, equirect=equirect)
        self._guide = Guide(device, layout, equirect=equirect, name="object", camera=camera)
        # Eq. 3 measures how alike diffuse pixels are; reflections differ from pixel to pixel.
        sparse = settings.mask.sparse and not features.specular_signal
        mask_settings = settings.mask.model_copy(update={"sparse": sparse})
        self._mask = Mask(device, self._guide, mask_settings, name="object")
        self._trace = TraceVirtual(device, self._guide, features)
        kinds: list[Kind] = ["diffuse"] if features.diffuse_signal else []
        kinds += ["specular"] if features.specular_signal else []
        self._filters = {
            kind: SignalFilter(device, self._guide, kind, settings, name=kind) for kind in kinds
        }
        self._reflections = (
            ReflectionMotion(device, self._guide)
            if features.specular_signal and settings.temporal.history == "fast-slow"
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
        seen, trace = self.visible, self._trace
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
