"""Inserted objects: their state for rays and in the view."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.bvh.scene import object_bounds
from iprt.device.compute import ComputeDevice
from iprt.device.fastest import timed_ways
from iprt.errors import DeviceError
from iprt.gbuffer.batch import int4
from iprt.gbuffer.context import FrameContext
from iprt.geometry.camera import View
from iprt.geometry.material import material_table
from iprt.geometry.mesh import Instance, same_places
from iprt.settings.features import Features
from iprt.world.objects.object_bvh import ObjectBvh, ObjectsArgs
from iprt.world.objects.object_layers import EMPTY, TracedLayers, VisibleLayer
from iprt.world.objects.visibility import Visibility, regions_of
from iprt.world.real.panorama import Panorama

if TYPE_CHECKING:
    from iprt.raster.rasterizer import Rasterizer

LOG = logging.getLogger("iprt.world.objects.objects")

BOX_MARGIN = 1e-3
"""Enlargement of the boxes around objects, as a fraction of their diagonals."""
LAYER_MARGIN = 0.02
"""Enlargement of boxes around rasterized surfaces, whose tangent planes protrude a little."""
MAX_LAYER_ROWS = 1024
"""Most rows of the equirect layers, in which off-screen rays intersect objects."""


class Objects:
    """Objects for rays and in the view, as triangles or rasterized layers.

    Attributes
    ----------
    version : int
        Number of states of the objects so far. A view compares it with its last frame's.
    bvh : ObjectBvh or None
        Hierarchy for rays; None: rays intersect layers.
    screen, equirect : TracedLayers or None
        Layers of the view, and around the capture centre.
    bounds : (N, 2, 4) float32
        `object_bounds()`; `device_bounds` is its copy on the device, `materials`
        `material_table()`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        instances: Sequence[Instance],
        view: View,
        panorama: Panorama,
        features: Features,
        hierarchy: Callable[[ComputeDevice, Sequence[Instance]], ObjectBvh] = ObjectBvh,
    ) -> None:
        """Create the buffers; `hierarchy` returns the objects' hierarchy, possibly shared."""
        self._device, self._instances, self._features = device, instances, features
        self.version = 1
        self._panorama = panorama
        self._equirect_view = view.projection == "equirect"
        self._rasterizer: Rasterizer | None = None
        self.screen: TracedLayers | None = None
        self.equirect: TracedLayers | None = None
        if features.traced_layers:
            traced = TracedLayers(device, view, "screen layers")
            self.screen, self.equirect = (None, traced) if self._equirect_view else (traced, None)
        if features.equirect_layers:
            self._place_layers_around(min(panorama.height, MAX_LAYER_ROWS))
        rays = features.primary_rays
        # Until objects come into view, when both ways to draw them are timed. On a CPU, OpenGL is
        # mostly software too, and rays are faster.
        self._undecided = rays and features.settings.gbuffer == "auto" and not device.is_cpu
        # Primary rays need the hierarchy even if other rays intersect layers.
        self._triangles = hierarchy(device, instances) if features.bvh or rays else None
        self.bvh = self._triangles if features.bvh else None
        self._visibility: Visibility | None = None
        if self._triangles is not None and rays:
            samples = features.settings.coverage_samples
            self._visibility = Visibility(device, view, self._triangles, instances, samples)
        self.bounds = self._bounds()
        self.device_bounds = device.upload("object bounds", self.bounds)
        materials = material_table([m for i in instances for m in i.mesh.materials])
        self.materials = device.upload("materials", materials)

    def _place_layers_around(self, rows: int) -> None:
        self._layer_view = View(2 * rows, rows, projection="equirect")
        self._layer_constants = self._device.upload(
            "equirect layer view", self._layer_view.kernel_constants()
        )
        self.equirect = TracedLayers(self._device, self._layer_view, "equirect layers")

    def move(self, instances: Sequence[Instance]) -> None:
        """Move the objects from the next `place` on. Does nothing if none has moved."""
        still = same_places(self._instances, instances)
        self._instances = instances
        if still:
            return
        self.version += 1
        self.bounds = self._bounds()
        self._device.write(self.device_bounds, self.bounds)

    def _bounds(self) -> NDArray[np.float32]:
        margin = LAYER_MARGIN if self._features.traced_layers else BOX_MARGIN
        return object_bounds(self._instances, margin=margin)

    def arguments(self, view: cla.Array | None) -> ObjectsArgs:
        """Return the objects for rays; `view` holds the constants of the view of `screen`."""
        if self.bvh is not None:
            return self.bvh.arguments(self.device_bounds)
        screen, equirect = self.screen, self.equirect
        return ObjectsArgs(
            bounds=self.device_bounds,
            count=len(self.bounds),
            screen=screen.arguments() if screen else None,
            equirect=equirect.arguments() if equirect else None,
            view=view,
            rectangle=int4(screen.rect if screen else EMPTY),
        )

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._rasterizer is not None:
            self._rasterizer.close()
            self._rasterizer = None

    def place(
        self, visible: VisibleLayer, view: View, previous: View, context: FrameContext
    ) -> None:
        """Update the objects, and draw them in the view.

        Parameters
        ----------
        visible : VisibleLayer
            Output.
        view, previous : View
            Views of `context`.

        Raises
        ------
        DeviceError
            No EGL where rasterized layers are traced.
        """
        triangles = self._triangles
        if triangles is not None and (context.objects_changed or not triangles.deforming):
            triangles.load(self._instances)
        if self._visibility is not None and context.objects_changed:
            self._visibility.follow(self._instances)
        if self._rasterizer is not None and context.objects_changed:
            self._rasterizer.move(self._instances)
        shown_anew = context.view_changed or context.video_changed or context.objects_changed
        decides = self._undecided and shown_anew and bool(regions_of(view, self.bounds))
        if self._visibility is None or self._features.traced_layers or decides:
            self._open_rasterizer(context)
        ways = self._ways(visible, view, previous if shown_anew else None, context)
        if decides and len(ways) > 1:
            ways = self._fastest(ways)
        for draw in ways.values():
            draw()

    def _ways(
        self, visible: VisibleLayer, view: View, previous: View | None, context: FrameContext
    ) -> dict[str, Callable[[], None]]:
        """Return the candidate ways to draw the view; none of them draws if `previous` is None."""
        ways: dict[str, Callable[[], None]] = {}
        rasterizer, visibility = self._rasterizer, self._visibility
        if rasterizer is not None:
            ways["OpenGL"] = lambda: self._rasterize(rasterizer, visible, view, previous, context)
        if visibility is not None and previous is not None:
            ways["rays"] = lambda: visibility.run(
                visible,
                view,
                context.view,
                context.previous,
                self._panorama,
                self.bounds,
                self.device_bounds,
                self.materials,
            )
        return ways

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
            self._visibility, self._triangles = None, self.bvh
        return {fastest: ways[fastest]}

    def _rasterize(
        self,
        rasterizer: Rasterizer,
        visible: VisibleLayer,
        view: View,
        previous: View | None,
        context: FrameContext,
    ) -> None:
        """Draw the view, unless `previous` is None, and the layers around the capture centre."""
        profile = self._device.profile
        if previous is not None:
            with profile.host("rasterize view"):
                layers = rasterizer.render(
                    view, previous, shade=True, back=self._features.traced_layers
                )
            if self._visibility is None or self._undecided:
                visible.load(layers, context.view, self.materials)
            traced = self.equirect if self._equirect_view else self.screen
            if traced is not None:
                traced.load(layers, context.view)
        if self._features.equirect_layers and context.objects_changed:
            assert self.equirect is not None
            with profile.host("rasterize panorama"):
                layers = rasterizer.render(self._layer_view, shade=False)
            self.equirect.load(layers, self._layer_constants)

    def _open_rasterizer(self, context: FrameContext) -> None:
        """Open OpenGL. Where it is missing and rays can replace it, choose rays."""
        if self._rasterizer is None:
            from iprt.raster.rasterizer import Rasterizer

            try:
                with self._device.profile.compiling("OpenGL"):
                    samples = self._features.settings.coverage_samples
                    self._rasterizer = Rasterizer(self._instances, samples)
                self._device.opengl = self._rasterizer.memory
            except DeviceError:
                if not self._undecided:
                    raise
                self._undecided = False
                return
        elif not context.video_changed:
            return
        self._rasterizer.set_surface(self._device.read(self._panorama.surface))
