"""The frame: what is done on each clock, and in which order. Read this file first.

Three clocks: the video frame (the panorama and what the tracer needs of it), object changes
(rasterized layers that rays meet), and the view frame (everything after). `Requirements` says
which passes exist for a scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.aovs import read_aov
from iprt.device.checked import checked
from iprt.device.compute import ComputeDevice
from iprt.gloss_pixels import GlossPixels
from iprt.objects import Objects
from iprt.passes.background import OTHER_LIGHT
from iprt.passes.camera_motion import STILL, CameraMotion
from iprt.passes.color_map import ColorMap
from iprt.passes.composite import Composite
from iprt.passes.guide import Guide
from iprt.passes.highlight import Highlight
from iprt.passes.irradiance import IrradianceCache
from iprt.passes.layout import PlaneLayout
from iprt.passes.lights import Lights, flux_change
from iprt.passes.panorama import Panorama
from iprt.passes.real_layer import RealLayer
from iprt.passes.world import World
from iprt.pixels import RatioMap, RealPixels, Tick, VirtualPixels
from iprt.requirements import Requirements
from iprt.scene.camera import View
from iprt.scene.cut import SWITCHED, is_cut
from iprt.scene.footage import Footage
from iprt.scene.frame import Frame
from iprt.scene.mesh import Instance, require_same_objects, same_places
from iprt.scene.pose import camera_motion, seen_from, view_from
from iprt.settings import Settings


@dataclass(frozen=True)
class RenderedFrame:
    """A finished picture.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance.
    aovs : dict of str to (H, W) or (H, W, 3) float32
        The auxiliary pictures asked for.
    """

    color: NDArray[np.float32]
    aovs: dict[str, NDArray[np.float32]]


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
    footage : Footage or None
        What frames have that are loaded later. None: what `frame` has.

    Attributes
    ----------
    fading : float
        Least share of a new frame in the temporal means from the next step on; at first that of
        the settings.

    Raises
    ------
    DeviceError
        No EGL where rasterized layers are traced, or too little device memory.
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
        footage: Footage | None = None,
    ) -> None:
        self.settings = settings or Settings()
        self.fading = self.settings.fading
        self.device = device = checked(device) if self.settings.check_kernels else device
        self.instances = tuple(instances)
        self.view = view
        self.background = background
        materials = [m for instance in self.instances for m in instance.mesh.materials]
        self.requirements = Requirements.of(
            materials,
            view,
            self.settings,
            footage or Footage.of(frame),
            deforming=any(instance.mesh.deforms for instance in self.instances),
        )
        self._equirect = view.projection == "equirect"
        self._objects: Objects | None = None
        self._frame_index = 0
        self._previous_view = view_from(view, frame.pose)
        self._view_stale = 2  # steps for which what depends on the view must be made anew
        self._video_stale = True
        self._objects_stale = 1  # frames for which the objects are not where they were
        self._cut = False

        self._camera: CameraMotion | None = None
        if self.requirements.moving_camera and frame.pose is not None:
            self._camera = CameraMotion(device, frame.pose)
        camera = None if self._camera is None else self._camera.rows

        self.layout = PlaneLayout(view.width, view.height)
        self.panorama = Panorama(
            device,
            frame.width,
            frame.height,
            outside=self.requirements.opening_environment,
            gloss=self.requirements.gloss,
            own_radiance=self.requirements.own_radiance,
            background=self.settings.trace if self.requirements.background else None,
        )
        self._view_constants = [device.zeros(f"view {i}", (16,)) for i in range(2)]
        self.real = RealLayer(
            device,
            self.layout,
            equirect=self._equirect,
            name="real",
            gloss=self.requirements.gloss,
            camera=camera,
            color_map=self.requirements.color_map and self.requirements.tracing,
        )
        self._color_map = ColorMap(device) if self.requirements.color_map else None
        self.composite = Composite(
            device,
            self.layout,
            relit=self.requirements.tracing,
            diffuse=self.requirements.diffuse_signal,
            specular=self.requirements.specular_signal,
            gloss=self.requirements.gloss,
            color_map=self.requirements.color_map,
        )
        self.real_pixels: RealPixels | None = None
        self.gloss_pixels: GlossPixels | None = None
        self._highlight: Highlight | None = None
        self.virtual_pixels: VirtualPixels | None = None
        self.ratio_map: RatioMap | None = None
        self.cache: IrradianceCache | None = None
        self._lights: Lights | None = None
        if self.requirements.objects:
            self._build_object_passes(frame, camera)
        self._frame = frame
        self.load(frame)

    def _build_object_passes(self, frame: Frame, camera: cla.Array | None) -> None:
        device, needs = self.device, self.requirements
        if needs.light_sampling:
            self._lights = Lights(device, frame.width, frame.height)
        if needs.delta:
            self.cache = IrradianceCache(device, needs)
        if needs.ratio_map:
            self.ratio_map = RatioMap(device, needs, camera)
        self.virtual_pixels = VirtualPixels(
            device, self.layout, needs, equirect=self._equirect, camera=camera
        )
        if needs.tracing:
            self.real_guide = Guide(
                device, self.layout, equirect=self._equirect, name="real", camera=camera
            )
            self.real_pixels = RealPixels(device, self.real, self.real_guide, needs, name="real")
        if needs.gloss:
            self._highlight = Highlight(device, self.panorama, needs)
            self.gloss_pixels = GlossPixels(
                device, self.layout, needs, equirect=self._equirect, camera=camera
            )
        placed = seen_from(self.instances, frame.pose)
        objects = Objects(device, placed, self.view, self.panorama, needs)
        self._objects = objects
        self.world = World(
            self.panorama,
            objects.screen,
            objects.equirect,
            bvh=objects.bvh,
            materials=objects.materials,
            bounds=objects.device_bounds,
            lights=self._lights,
            highlight=self._highlight,
        )

    def close(self) -> None:
        """Release the OpenGL context."""
        if self._objects is not None:
            self._objects.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # The frame ------------------------------------------------------------------------------

    def step(self) -> None:
        """Render one view frame; temporal passes build on the ones before."""
        tick = Tick(
            self._frame_index,
            view=self._view_constants[0],
            previous=self._view_constants[1],
            view_changed=self._view_stale > 0,
            video_changed=self._video_stale,
            objects_changed=self._objects_stale > 0,
            fading=self.fading,
            cut=self._cut,
        )
        view = view_from(self.view, self._frame.pose)
        self._place_view(tick, view)
        self._resample_real_layer(tick)
        if self.virtual_pixels is None or self._objects is None:
            self.composite.run(self.real.color)
        else:
            self._objects.place(self.virtual_pixels.visible, view, self._previous_view, tick)
            ratio = self._relight(tick)
            self.virtual_pixels.run(self.world, tick)
            self._composite(self.virtual_pixels, ratio)
        self._frame_index += 1
        self._video_stale = self._cut = False
        self._objects_stale = max(self._objects_stale - 1, 0)
        self._view_stale = max(self._view_stale - 1, 0)
        self._previous_view = view
        self.device.profile.end_frame()

    def _place_view(self, tick: Tick, now: View) -> None:
        if self._camera is not None:
            self._camera.step()
        if tick.view_changed:
            for rows, view in zip(self._view_constants, (now, self._previous_view), strict=True):
                self.device.write(rows, view.kernel_constants())

    def _resample_real_layer(self, tick: Tick) -> None:
        highlight = self._highlight
        if highlight is not None and tick.video_changed:
            highlight.run()
        if tick.view_changed or tick.video_changed:
            self.real.run(
                self.panorama,
                *self._view_constants,
                real_materials=None if highlight is None else highlight.table,
                color_map=self._color_map_rows,
            )
            if self.background is not None:
                self.real.replace_color(self.background, self._color_map_rows)
        if self.requirements.tracing:
            self.real_guide.run(tick.view, self.real.normal, self.real.depth, self.real.id)

    def _relight(self, tick: Tick) -> cla.Array | None:
        if self.real_pixels is None:
            return None
        ratio = self.real_pixels.run(self.world, self.cache, tick)
        if self.ratio_map is not None:
            self.ratio_map.run(self.world, self.cache, tick)
        if self.requirements.relit_reflections:
            self.world.relight(ratio, self.view, tick.view, self.ratio_map)
        if self.gloss_pixels is not None:
            self.gloss_pixels.run(self.world, self.real, tick)
        return ratio

    def _composite(self, pixels: VirtualPixels, ratio: cla.Array | None) -> None:
        self.composite.run(
            self.real.color,
            ratio=ratio,
            base=self.real.diffuse,
            change=None if self.gloss_pixels is None else self.gloss_pixels.change,
            coverage=pixels.visible.coverage,
            albedo=pixels.visible.albedo,
            diffuse=pixels.reflected.get("diffuse"),
            specular=pixels.reflected.get("specular"),
            color_map=self._color_map_rows,
        )

    @property
    def frame(self) -> Frame:
        """The video frame that is shown."""
        return self._frame

    @property
    def _color_map_rows(self) -> cla.Array | None:
        return None if self._color_map is None else self._color_map.rows

    # Use ------------------------------------------------------------------------------------

    def load(self, frame: Frame) -> None:
        """Go on with another frame of the video, of the same size and with the same openings.

        Raises
        ------
        ValueError
            It has a pose and the frame before has none, or the other way round.
        """
        needs = self.requirements
        assert needs.own_radiance or not (needs.objects and frame.own_radiance), "no buffer for it"
        motion = camera_motion(self._frame.pose, frame.pose)
        mapped = needs.objects and frame.color_map is not None
        assert needs.color_map or not mapped, "no kernel for it"
        self.panorama.load(frame)
        if self._color_map is not None:
            self._color_map.load(frame.color_map)
        if needs.objects:
            changed = flux_change(self._frame.radiance, frame.radiance)
            cut = is_cut(self._frame, frame, changed)
            self._cut = self._cut or cut or changed > SWITCHED
            elsewhere = cut or not np.array_equal(motion, STILL)
            hidden = self.panorama.remember(forget=elsewhere or changed > OTHER_LIGHT)
            if self._lights is not None:
                self._lights.load(frame.radiance, hidden)
            if self.cache is not None:
                self.cache.place(self.world, self._frame, frame, motion, changed=changed, cut=cut)
        self._frame = frame
        self._video_stale = True
        if np.array_equal(motion, STILL):
            return
        self._view_stale = 2
        if self._camera is not None and self._objects is not None and frame.pose is not None:
            self._camera.pose = frame.pose
            self._objects.move(seen_from(self.instances, frame.pose))
            self._objects_stale = 2

    def move(self, instances: Iterable[Instance]) -> None:
        """Follow the objects to where they are now. Nothing is done if none has moved.

        Parameters
        ----------
        instances : iterable of Instance
            The same objects, in the same order, with other transforms; and other vertices, where a
            mesh deforms.

        Raises
        ------
        SceneError
            They are others, or a transform is not 4x4 finite numbers. The renderer stays as it was.
        """
        moved = tuple(instances)
        require_same_objects(self.instances, moved)
        still = same_places(self.instances, moved)
        self.instances = moved
        if still or self._objects is None:
            return
        self._objects.move(seen_from(moved, self._frame.pose))
        self._objects_stale = 2  # their motion ends in the frame after the last one that moves them

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
        aovs : names from `iprt.aovs.AOVS`
        progress : callable or None
            Called with the number of finished frames after each.
        """
        for index in range(frames):
            self.step()
            self.device.wait()
            if progress is not None:
                progress(index + 1)
        color = np.ascontiguousarray(self.device.read(self.composite.picture)[..., :3])
        return RenderedFrame(color, {name: read_aov(self, name) for name in aovs})
