"""The two kinds of pixels of a view: real surfaces that are relit, virtual ones that are shaded."""

from __future__ import annotations

from dataclasses import dataclass

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.passes.atrous import Atrous
from iprt.passes.guide import Guide
from iprt.passes.interpolate import Interpolate
from iprt.passes.layout import PlaneLayout
from iprt.passes.mask import Mask, grid_offset
from iprt.passes.object_layers import VisibleLayer
from iprt.passes.real_layer import RealLayer
from iprt.passes.relight import Relight
from iprt.passes.temporal import Kind, Temporal, signal_planes
from iprt.passes.trace import TraceReal, TraceVirtual
from iprt.passes.world import World
from iprt.requirements import Requirements
from iprt.settings import Settings


@dataclass(frozen=True)
class Tick:
    """The view frame that is being rendered.

    Attributes
    ----------
    index : int
        Frames since the start.
    changed : bool
        Objects or the video moved since the frame before.
    view : (16,) float32
        `View.kernel_constants()` on the device.
    """

    index: int
    changed: bool
    view: cla.Array


class SignalFilter:
    """Sparse samples of one signal become a clean picture: interpolate, accumulate, filter."""

    def __init__(self, device: ComputeDevice, guide: Guide, kind: Kind, settings: Settings) -> None:
        self._fading = settings.fading
        self._interpolate = Interpolate(device, guide, signal_planes(kind), settings.interpolate)
        self._temporal = Temporal(device, guide, kind, settings.temporal, name=kind)
        self._atrous = Atrous(device, guide, kind, settings.atrous, name=kind)

    def run(
        self,
        signal: cla.Array,
        mask: Mask,
        motion: cla.Array,
        tick: Tick,
        *,
        roughness: cla.Array | None = None,
        rect: tuple[int, int, int, int] | None = None,
    ) -> cla.Array:
        """The filtered planes of `signal`, which holds values where `mask` had rays traced."""
        self._interpolate.run(mask.level, signal, grid_offset(tick.index))
        accumulated = self._temporal.run(
            signal, motion, mask.level, fading=self._fading, changed=tick.changed
        )
        return self._atrous.run(accumulated, roughness=roughness, rect=rect)


class RealPixels:
    """Irradiance of real surfaces with and without objects: Algorithm 1, lines 1-9.

    Attributes
    ----------
    relight : Relight
        Holds E_RV / E_R.
    irradiance : 6 planes or None
        E_R and E_RV over π, filtered, after the first frame.
    """

    def __init__(self, device: ComputeDevice, guide: Guide, requirements: Requirements) -> None:
        settings = requirements.settings
        self._guide = guide
        self.mask = Mask(device, guide, settings.mask, name="real")
        self._trace = TraceReal(device, guide, requirements)
        self._filter = SignalFilter(device, guide, "real", settings)
        self.relight = Relight(device, guide)
        self.irradiance: cla.Array | None = None

    def run(self, world: World, layer: RealLayer, tick: Tick) -> cla.Array:
        """Relight the frame's real pixels and return the ratio per pixel."""
        motion, panorama = layer.motion, world.panorama
        self.mask.run(grid_offset(tick.index), motion=motion, metre=panorama.scale)
        self._trace.run(world, self.mask, tick.view)
        self.irradiance = self._filter.run(self._trace.signal, self.mask, motion, tick)
        self.relight.run(self.irradiance, layer.color, scale=panorama.mean_radiance)
        return self.relight.ratio


class VirtualPixels:
    """Light that visible virtual surfaces reflect: Algorithm 1, lines 10-16.

    Attributes
    ----------
    visible : VisibleLayer
    reflected : dict of {"diffuse", "specular"} to 3 planes
        Filtered, after the first frame.
    """

    def __init__(
        self,
        device: ComputeDevice,
        layout: PlaneLayout,
        requirements: Requirements,
        *,
        equirect: bool,
    ) -> None:
        settings = requirements.settings
        self.visible = VisibleLayer(device, layout, equirect=equirect)
        self._guide = Guide(device, layout, equirect=equirect, name="object")
        # Eq. 3 measures how alike diffuse pixels are; reflections differ from pixel to pixel.
        sparse = settings.mask.sparse and not requirements.specular_signal
        mask_settings = settings.mask.model_copy(update={"sparse": sparse})
        self._mask = Mask(device, self._guide, mask_settings, name="object")
        self._trace = TraceVirtual(device, self._guide, requirements)
        kinds: list[Kind] = ["diffuse"] if requirements.diffuse_signal else []
        kinds += ["specular"] if requirements.specular_signal else []
        self._filters = {kind: SignalFilter(device, self._guide, kind, settings) for kind in kinds}
        self.reflected: dict[Kind, cla.Array] = {}

    def run(self, world: World, ratio: cla.Array | None, tick: Tick) -> None:
        """Shade the frame's virtual pixels; `ratio` relights what they reflect."""
        seen, trace = self.visible, self._trace
        self._guide.run(tick.view, seen.normal, seen.depth, seen.id)
        self._mask.run(grid_offset(tick.index), motion=seen.motion, metre=world.panorama.scale)
        trace.run(world, self._mask, tick.view, seen.albedo, ratio)
        signals = {"diffuse": trace.diffuse, "specular": trace.specular}
        for kind, signal_filter in self._filters.items():
            self.reflected[kind] = signal_filter.run(
                signals[kind],
                self._mask,
                seen.motion,
                tick,
                roughness=seen.roughness if kind == "specular" else None,
                rect=seen.rect,
            )
