"""View at a lower resolution, one pixel per block of pixels, for light, and its upsampling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pyopencl.array as cla
from pyopencl import cltypes

from iprt.compositing.object_layer import VisibleSurfaces
from iprt.compositing.real_layer import REAL_LAYER_READS, RealLayer
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.filter.interpolate import NORMAL_SHARPNESS, PLANE_SHARPNESS
from iprt.gbuffer.context import FrameContext, ViewConstants
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.method import GBuffer, Image, Method, Signals
from iprt.passes import Clock, Pass
from iprt.settings.features import Features
from iprt.world.world import World

_Layer = RealLayer | VisibleSurfaces


def block_map(view: View, reduced: View) -> tuple[float, float, float, float]:
    """Return scale x y and offset x y from image points of a view to the reduced one's."""
    if view.projection == "equirect":
        return reduced.width / view.width, reduced.height / view.height, 0.0, 0.0
    # Both have the same centre.
    scale = reduced.focal_px / view.focal_px
    x = 0.5 * (reduced.width - view.width * scale)
    y = 0.5 * (reduced.height - view.height * scale)
    return scale, scale, x, y


def enlarging_size(view: View, reduced: View, *, wide: bool) -> tuple[int, int]:
    """Return work items of `cl/compositing/enlarge.cl`: pixels, or, `wide`, gaps between blocks."""
    if wide:
        return reduced.width + 1, reduced.height + 1
    return view.width, view.height


class LightView:
    """Light at a fraction of the view's resolution, upsampled along surfaces.

    Outlines and textures keep the view's resolution, because only signals without albedo are
    upsampled.

    Attributes
    ----------
    view : View
        `View.reduced` of the view.
    layout : PlaneLayout
    gbuffer : GBuffer
        Surfaces at the centres of blocks; of objects, at the covered pixel nearest to the centre.
    """

    def __init__(
        self,
        device: ComputeDevice,
        full: GBuffer,
        view: View,
        features: Features,
        camera: cla.Array | None,
    ) -> None:
        """Create buffers and kernels; `full` is the G-buffer of the view."""
        self._device, self._full_view = device, view
        self._scale = features.settings.light_scale
        self.view = view.reduced(self._scale)
        self.layout = PlaneLayout.of(self.view)
        self._constants = ViewConstants(device, "light view")
        self._map = block_map(view, self.view)
        real = RealLayer(
            device,
            self.layout,
            name="light",
            gloss=features.gloss,
            camera=camera,
            color_map=features.color_map and features.relit,
            clipped=features.clipped,
        )
        visible = VisibleSurfaces(
            device, self.layout, name="light object", needs=features.materials
        )
        self.gbuffer = GBuffer(real, visible)
        self._reduce = device.kernel("compositing/reduce.cl", "reduce_objects").fixed(
            self.layout.arguments(),
            full.objects.planes("full_"),
            visible.planes(),
            full_width=view.width,
            full_height=view.height,
            to_block=cltypes.make_float4(*self._map),
        )
        self._enlarged: dict[str, cla.Array] = {}
        self._enlarge: dict[str, Kernel] = {}
        self._enlarging_size = enlarging_size(view, self.view, wide=device.wide)
        surfaces, objects = (full.real, real), (full.objects, visible)
        if features.relit:
            self._add("ratio", *surfaces, "id")
        if features.gloss:
            self._add("change", *surfaces, "gloss")
        if features.diffuse_signal:
            self._add("diffuse", *objects, "id")
        if features.specular_signal:
            self._add("specular", *objects, "id")

    def _add(self, signal: str, full: _Layer, blocks: _Layer, ids: str) -> None:
        """Add the upsampling of a layer's signal; `ids` names the plane of ids that never mix."""
        device, ratio = self._device, signal == "ratio"
        layout = PlaneLayout.of(self._full_view)
        shape = (layout.width * layout.height, 4) if ratio else layout.shape(3)
        self._enlarged[signal] = device.zeros(f"enlarged {signal}", shape)
        defines = {"RATIO": ratio, "WIDE": device.wide}
        self._enlarge[signal] = device.kernel("compositing/enlarge.cl", "enlarge", defines).fixed(
            layout.arguments(),
            block_width=self.view.width,
            block_height=self.view.height,
            to_block=cltypes.make_float4(*self._map),
            normal=full.normal,
            depth=full.depth,
            id=getattr(full, ids),
            block_normal=blocks.normal,
            block_depth=blocks.depth,
            block_id=getattr(blocks, ids),
            light=self._enlarged[signal],
            normal_sharpness=NORMAL_SHARPNESS,
            plane_sharpness=PLANE_SHARPNESS,
        )

    def begin(self, context: FrameContext) -> None:
        """Begin a frame, before its passes run."""
        now, before = (v.reduced(self._scale) for v in (context.camera, context.previous_camera))
        self._constants.follow(now, before)
        constants = {"view": self._constants.current, "previous": self._constants.previous}
        self._here = replace(context, camera=now, previous_camera=before, **constants)

    def passes(self, world: World, method: Method) -> list[Pass[FrameContext]]:
        """Return the passes of a method at this resolution, and the passes before and after."""

        def resample(_: FrameContext) -> None:
            self.gbuffer.real.show(world.real, self._here)

        def enlarge(context: FrameContext) -> None:
            self._enlarge_light(method.signals, context)

        def reduced(run: Callable[[FrameContext], None]) -> Callable[[FrameContext], None]:
            return lambda _: run(self._here)

        layers, light = ("real layer", "object layer"), ("ratio", "real light", "reflected light")
        return [
            Pass("resample", Clock.VIEW, resample, REAL_LAYER_READS, ("real blocks",)),
            Pass("reduce", Clock.VIEW, self._reduce_objects, layers, ("object blocks",)),
            *(replace(one, run=reduced(one.run)) for one in method.passes(world)),
            Pass("enlarge", Clock.FRAME, enlarge, light, ("light",)),
        ]

    def _reduce_objects(self, context: FrameContext) -> None:
        self._reduce(self.layout.size, view=self._here.view, full_view=context.view)

    def _enlarge_light(self, signals: Signals, context: FrameContext) -> None:
        for name, kernel in self._enlarge.items():
            kernel(
                self._enlarging_size,
                view=context.view,
                block_view=self._constants.current,
                block_light=getattr(signals, name),
            )

    @property
    def signals(self) -> Signals:
        """Signals of the last frame, for each pixel of the view."""
        return Signals(**self._enlarged)

    def repeated(self, image: Image) -> Image:
        """Return a picture of blocks (h, w) or (h, w, C), repeated for each pixel."""
        view, (x_scale, y_scale, x_offset, y_offset) = self._full_view, self._map
        columns = ((np.arange(view.width) + 0.5) * x_scale + x_offset).astype(np.intp)
        rows = ((np.arange(view.height) + 0.5) * y_scale + y_offset).astype(np.intp)
        return image[np.ix_(rows, columns)]
