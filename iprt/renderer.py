"""The frame: what is done on each clock, and in which order. Read this file first.

Three clocks (`docs/design.md`): the video frame (panorama), object changes (rasterized layers) and
the view frame (everything after). `Requirements` says which passes exist for a scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.passes.atrous import Atrous
from iprt.passes.composite import Composite
from iprt.passes.guide import Guide
from iprt.passes.interpolate import Interpolate
from iprt.passes.layout import PlaneLayout
from iprt.passes.mask import Mask, grid_offset
from iprt.passes.object_layers import TracedLayers, VisibleLayer, object_bounds
from iprt.passes.panorama import Panorama
from iprt.passes.real_layer import RealLayer
from iprt.passes.relight import Relight
from iprt.passes.temporal import Kind, Temporal, signal_planes
from iprt.passes.trace import TraceReal, TraceVirtual, World
from iprt.requirements import Requirements
from iprt.scene.camera import View
from iprt.scene.frame import Frame
from iprt.scene.material import material_table
from iprt.scene.mesh import Instance
from iprt.settings import Settings

if TYPE_CHECKING:
    from iprt.raster.rasterizer import Rasterizer

MAX_LAYER_ROWS = 1024
"""Rows of the equirect layers that off-screen rays meet objects in, at most."""


@dataclass(frozen=True)
class RenderedFrame:
    """A finished picture.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance.
    aovs : dict of str to (H, W) or (H, W, 3) float32
        The intermediate images asked for.
    """

    color: NDArray[np.float32]
    aovs: dict[str, NDArray[np.float32]]


class SignalFilter:
    """Sparse samples of one signal become a clean picture: interpolate, accumulate, filter."""

    def __init__(
        self, device: ComputeDevice, guide: Guide, kind: Kind, settings: Settings
    ) -> None:
        self._interpolate = Interpolate(device, guide, signal_planes(kind), settings.interpolate)
        self._temporal = Temporal(device, guide, kind, settings.temporal, name=kind)
        self._atrous = Atrous(device, guide, kind, settings.atrous, name=kind)
        self.length: cla.Array | None = None

    def run(
        self,
        signal: cla.Array,
        mask: Mask,
        motion: cla.Array,
        *,
        offset: tuple[int, int],
        fading: float,
        changed: bool,
        roughness: cla.Array | None = None,
        rect: tuple[int, int, int, int] | None = None,
    ) -> cla.Array:
        self._interpolate.run(mask.level, signal, offset)
        accumulated = self._temporal.run(signal, motion, fading=fading, changed=changed)
        self.length = accumulated.length
        return self._atrous.run(accumulated, roughness=roughness, rect=rect)


class Renderer:
    """Inserts objects into a 360° RGBD frame, for one view.

    Parameters
    ----------
    device : ComputeDevice
    frame : Frame
        The video frame.
    instances : iterable of Instance
        The objects to insert.
    view : View
        Equirect views show the whole panorama; they do not turn.
    settings : Settings
    background : (H, W, 3) float32 or None
        Linear radiance to composite over in place of the resampled panorama.

    Raises
    ------
    DeviceError
        No EGL, or too little device memory.
    """

    def __init__(
        self,
        device: ComputeDevice,
        frame: Frame,
        instances: Iterable[Instance],
        view: View,
        settings: Settings | None = None,
        *,
        background: NDArray[np.float32] | None = None,
    ) -> None:
        self.device = device
        self.settings = settings or Settings()
        self.instances = tuple(instances)
        self.view = view
        self.background = background
        materials = [m for instance in self.instances for m in instance.mesh.materials]
        self.requirements = Requirements.of(materials, view, self.settings)
        self._frame_index = 0
        self._previous_view = view
        self._scene_changed = False   # objects or video, since the last step
        self._view_stale = 2          # steps for which view-dependent layers must be redone
        self._rasterizer: Rasterizer | None = None

        self.panorama = Panorama(device, frame.width, frame.height)
        self._view_buffers = [device.zeros(f"view {i}", (16,)) for i in range(2)]
        self._build_view_passes()
        if self.requirements.objects:
            self._build_object_passes(material_table(materials))
        self.panorama.load(frame)
        self._surface_stale = True

    # Construction ---------------------------------------------------------------------------

    def _build_view_passes(self) -> None:
        device, view = self.device, self.view
        self._equirect = view.projection == "equirect"
        self.layout = PlaneLayout(view.width, view.height)
        self.real = RealLayer(device, self.layout, equirect=self._equirect)
        self.real_guide = Guide(device, self.layout, equirect=self._equirect, name="real")
        self.composite = Composite(
            device,
            self.layout,
            relit=self.requirements.tracing,
            diffuse=self.requirements.diffuse_signal,
            specular=self.requirements.specular_signal,
        )

    def _build_object_passes(self, table: NDArray[np.float32]) -> None:
        device, needs, settings = self.device, self.requirements, self.settings
        self.visible = VisibleLayer(device, self.layout, equirect=self._equirect)
        self.object_guide = Guide(device, self.layout, equirect=self._equirect, name="object")
        self.object_mask = Mask(device, self.object_guide, settings.mask, name="object")
        self.trace_virtual = TraceVirtual(device, self.object_guide, needs)
        kinds: list[Kind] = ["diffuse"] if needs.diffuse_signal else []
        kinds += ["specular"] if needs.specular_signal else []
        self.object_filters = {
            kind: SignalFilter(device, self.object_guide, kind, settings) for kind in kinds
        }
        screen = equirect = None
        if needs.tracing:
            self.real_mask = Mask(device, self.real_guide, settings.mask, name="real")
            self.trace_real = TraceReal(device, self.real_guide, needs)
            self.real_filter = SignalFilter(device, self.real_guide, "real", settings)
            self.relight = Relight(device, self.real_guide)
            traced_view = TracedLayers(device, self.view, "traced view")
            screen, equirect = (None, traced_view) if self._equirect else (traced_view, None)
        if needs.equirect_layers:
            rows = min(self.panorama.height, MAX_LAYER_ROWS)
            self._layer_view = View(2 * rows, rows, projection="equirect")
            self._layer_constants = device.upload(
                "layer view", self._layer_view.kernel_constants()
            )
            equirect = TracedLayers(device, self._layer_view, "traced panorama")
        self.world = World(self.panorama, screen, equirect, device.upload("materials", table))
        self.world.bounds = device.upload("object bounds", object_bounds(self.instances))
        self._layers_stale = True

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._rasterizer is not None:
            self._rasterizer.close()
            self._rasterizer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # The frame ------------------------------------------------------------------------------

    def step(self) -> None:
        """Render one view frame; temporal passes build on the ones before."""
        self._place_view()
        self._resample_real_layer()
        ratio = None
        if self.requirements.objects:
            self._rasterize_objects()
        if self.requirements.tracing:
            ratio = self._relight_real_pixels()
        parts = self._shade_virtual_pixels(ratio) if self.requirements.objects else {}
        self._composite(ratio, parts)

        self._frame_index += 1
        self._scene_changed = False
        self._view_stale = max(self._view_stale - 1, 0)
        self._previous_view = self.view
        self.device.profile.frames += 1

    def _place_view(self) -> None:
        if self._view_stale:
            now, before = self._view_buffers
            self.device.write(now, self.view.kernel_constants())
            self.device.write(before, self._previous_view.kernel_constants())

    def _resample_real_layer(self) -> None:
        if self._view_stale or self._scene_changed:
            self.real.run(self.panorama, *self._view_buffers)
            if self.background is not None:
                self.real.replace_color(self.background)
        view, real = self._view_buffers[0], self.real
        self.real_guide.run(view, real.normal, real.depth, real.id)

    def _rasterize_objects(self) -> None:
        profile, view = self.device.profile, self._view_buffers[0]
        rasterizer = self._open_rasterizer()
        if self._surface_stale:
            rasterizer.set_surface(self.device.read(self.panorama.surface))
            self._surface_stale = False
        if self._view_stale or self._scene_changed:
            with profile.host("rasterize view"):
                layers = rasterizer.render(self.view, self._previous_view, shade=True)
            self.visible.load(layers, view, self.world.materials)
            traced = self.world.equirect if self._equirect else self.world.screen
            if traced is not None:
                traced.load(layers, view)
        if self.requirements.equirect_layers and self._layers_stale:
            assert self.world.equirect is not None
            with profile.host("rasterize panorama"):
                layers = rasterizer.render(self._layer_view, shade=False)
            self.world.equirect.load(layers, self._layer_constants)
            self._layers_stale = False
        seen = self.visible
        self.object_guide.run(view, seen.normal, seen.depth, seen.id)

    def _open_rasterizer(self) -> Rasterizer:
        if self._rasterizer is None:
            from iprt.raster.rasterizer import Rasterizer

            with self.device.profile.compiling():
                self._rasterizer = Rasterizer(self.instances)
        return self._rasterizer

    def _relight_real_pixels(self) -> cla.Array:
        """E_R and E_RV of real pixels, and their ratio: Algorithm 1, lines 1-9."""
        offset = grid_offset(self._frame_index)
        motion = self.real.motion
        self.real_mask.run(offset, motion=motion, metre=self.panorama.scale)
        self.trace_real.run(self.world, self.real_mask, self._view_buffers[0])
        filtered = self.real_filter.run(
            self.trace_real.signal,
            self.real_mask,
            motion,
            offset=offset,
            fading=self.settings.fading,
            changed=self._scene_changed,
        )
        self.relight.run(filtered, scale=self.panorama.mean_radiance)
        self._irradiance = filtered
        return self.relight.ratio

    def _shade_virtual_pixels(self, ratio: cla.Array | None) -> dict[Kind, cla.Array]:
        """Light reflected by virtual pixels: Algorithm 1, lines 10-16."""
        offset = grid_offset(self._frame_index)
        seen, mask, trace = self.visible, self.object_mask, self.trace_virtual
        mask.run(offset, motion=seen.motion, metre=self.panorama.scale)
        trace.run(self.world, mask, self._view_buffers[0], seen.albedo, ratio)
        signals = {"diffuse": trace.diffuse, "specular": trace.specular}
        return {
            kind: signal_filter.run(
                signals[kind],
                mask,
                seen.motion,
                offset=offset,
                fading=self.settings.fading,
                changed=self._scene_changed,
                roughness=seen.roughness if kind == "specular" else None,
                rect=seen.rect,
            )
            for kind, signal_filter in self.object_filters.items()
        }

    def _composite(self, ratio: cla.Array | None, parts: dict[Kind, cla.Array]) -> None:
        self._parts = parts
        if not self.requirements.objects:
            self.composite.run(self.real.color)
            return
        self.composite.run(
            self.real.color,
            ratio=ratio,
            coverage=self.visible.coverage,
            albedo=self.visible.albedo,
            diffuse=parts.get("diffuse"),
            specular=parts.get("specular"),
        )

    # Use ------------------------------------------------------------------------------------

    def look(self, view: View) -> None:
        """Turn the camera; size and projection stay."""
        assert (view.width, view.height) == (self.view.width, self.view.height)
        assert view.projection == self.view.projection
        self.view = view
        self._view_stale = 2

    def render(
        self,
        frames: int = 1,
        aovs: Iterable[str] = (),
        progress: Callable[[int], None] | None = None,
    ) -> RenderedFrame:
        """Accumulate `frames` frames of the still scene and return the picture.

        Parameters
        ----------
        frames : int
        aovs : names from `AOVS`
        progress : callable or None
            Called with the number of finished frames after each.
        """
        for index in range(frames):
            self.step()
            self.device.queue.finish()
            if progress is not None:
                progress(index + 1)
        color = np.ascontiguousarray(self.device.read(self.composite.picture)[..., :3])
        return RenderedFrame(color, {name: self.aov(name) for name in aovs})
