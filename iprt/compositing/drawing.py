"""Objects drawn in the view, by OpenGL or by primary rays."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from iprt.compositing.object_layer import VisibleLayer
from iprt.compositing.visibility import Visibility, regions_of
from iprt.device.compute import ComputeDevice
from iprt.device.fastest import timed_ways
from iprt.errors import DeviceError
from iprt.gbuffer.context import FrameContext
from iprt.geometry.camera import View
from iprt.passes import Clock, Pass
from iprt.settings.features import Features
from iprt.world.objects.objects import Objects
from iprt.world.real.panorama import Panorama

if TYPE_CHECKING:
    from iprt.raster.rasterizer import Rasterizer

LOG = logging.getLogger("iprt.compositing.drawing")


class Drawing:
    """Objects in the view and, where rays meet layers, in these.

    Parameters
    ----------
    device : ComputeDevice
    visible : VisibleLayer
        Output.
    objects : Objects
    panorama : Panorama
        Real surfaces that hide objects.
    view : View
    features : Features

    Raises
    ------
    DeviceError
        Raised by the passes: no EGL where rasterized layers are traced.
    """

    def __init__(
        self,
        device: ComputeDevice,
        visible: VisibleLayer,
        objects: Objects,
        panorama: Panorama,
        view: View,
        features: Features,
    ) -> None:
        self._device, self._visible, self._objects = device, visible, objects
        self._panorama, self._features = panorama, features
        self._samples = features.settings.coverage_samples
        self._rasterizer: Rasterizer | None = None
        self._visibility: Visibility | None = None
        rays = features.primary_rays
        # Until objects come into view, when both ways to draw them are timed. On a CPU, OpenGL is
        # mostly software too, and rays are faster.
        self._undecided = rays and features.settings.gbuffer == "auto" and not device.is_cpu
        if rays and objects.triangles is not None:
            given = device, view, objects.triangles, objects.instances, self._samples
            self._visibility = Visibility(*given)
        if features.equirect_layers and objects.around is not None:
            constants = objects.around.view.kernel_constants()
            self._around_constants = device.upload("equirect layer view", constants)

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._rasterizer is not None:
            self._rasterizer.close()
            self._rasterizer = None

    def passes(self) -> list[Pass[FrameContext]]:
        """Return the passes that draw the objects."""
        layer = ("surfaces", "object motion", "occluders", Clock.MOTION)
        passes: list[Pass[FrameContext]] = [
            Pass("object motion", Clock.MOTION, self._follow, ("hierarchy",), ("object motion",)),
            Pass("occluders", Clock.VIDEO, self._load_occluders, ("surfaces",), ("occluders",)),
            Pass("draw objects", Clock.VIEW, self._draw, layer, ("object layer",)),
        ]
        if self._features.equirect_layers:
            moved = ("object motion",)
            drawn = ("layers around",)
            passes.append(Pass("draw layers around", Clock.MOTION, self._draw_around, moved, drawn))
        return passes

    def _follow(self, _: FrameContext) -> None:
        """Pass the objects' positions, and their positions before, to what draws them."""
        if self._visibility is not None:
            self._visibility.follow(self._objects.instances)
        if self._rasterizer is not None:
            self._rasterizer.move(self._objects.instances)

    def _load_occluders(self, _: FrameContext | None = None) -> None:
        if self._rasterizer is not None:
            self._rasterizer.set_surface(self._device.read(self._panorama.surface))

    def _draw(self, context: FrameContext) -> None:
        decides = self._undecided and bool(regions_of(context.camera, self._objects.bounds))
        if self._visibility is None or self._features.traced_layers or decides:
            self._open_rasterizer()
        ways: dict[str, Callable[[], None]] = {}
        rasterizer, visibility = self._rasterizer, self._visibility
        if rasterizer is not None:
            ways["OpenGL"] = lambda: self._rasterize(rasterizer, context)
        if visibility is not None:
            ways["rays"] = lambda: self._trace(visibility, context)
        if decides and len(ways) > 1:
            ways = self._fastest(ways)
        for draw in ways.values():
            draw()

    def _fastest(self, ways: dict[str, Callable[[], None]]) -> dict[str, Callable[[], None]]:
        """Return the faster way to draw the view, and release the buffers of the other."""
        times = timed_ways(self._device, ways)
        fastest = min(times, key=times.__getitem__)
        told = ", ".join(f"{name} {ms:.2f} ms" for name, ms in times.items())
        LOG.debug("objects in the view are drawn by %s, which is faster: %s", fastest, told)
        self._undecided = False
        if fastest == "rays":
            self.close()
            self._device.opengl = {}
        elif self._visibility is not None:
            self._visibility.close()
            self._visibility, self._objects.triangles = None, self._objects.bvh
        return {fastest: ways[fastest]}

    def _trace(self, visibility: Visibility, context: FrameContext) -> None:
        objects = self._objects
        visibility.run(
            self._visible,
            context.camera,
            context.view,
            context.previous,
            self._panorama,
            objects.bounds,
            objects.device_bounds,
            objects.materials,
        )

    def _rasterize(self, rasterizer: Rasterizer, context: FrameContext) -> None:
        layered = self._features.traced_layers
        with self._device.profile.host("rasterize"):
            layers = rasterizer.render(
                context.camera, context.previous_camera, shade=True, back=layered
            )
        if self._visibility is None or self._undecided:
            self._visible.load(layers, context.view, self._objects.materials)
        if layered:
            traced = self._objects.screen or self._objects.around
            assert traced is not None
            traced.load(layers, context.view)

    def _draw_around(self, _: FrameContext) -> None:
        around = self._objects.around
        assert around is not None
        assert self._rasterizer is not None
        with self._device.profile.host("rasterize"):
            layers = self._rasterizer.render(around.view, shade=False)
        around.load(layers, self._around_constants)

    def _open_rasterizer(self) -> None:
        """Open OpenGL. Where it is missing and rays can replace it, choose rays."""
        if self._rasterizer is not None:
            return
        from iprt.raster.rasterizer import Rasterizer

        try:
            with self._device.profile.compiling("OpenGL"):
                self._rasterizer = Rasterizer(self._objects.instances, self._samples)
        except DeviceError:
            if not self._undecided:
                raise
            self._undecided = False
            return
        self._device.opengl = self._rasterizer.memory
        self._load_occluders()
