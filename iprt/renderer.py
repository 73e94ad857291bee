"""Renderer: the work on each clock, and its order. Read this file first.

There are three clocks: the video (`RealWorld`: the panorama and data derived from it for rays), the
objects (`Objects`: their geometry for rays), and the view (everything after). A view compares the
versions of both worlds with its last frame's. `Features` tells which passes a scene needs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from iprt.aovs import read_aov
from iprt.device.compute import ComputeDevice
from iprt.filter.mask import tracing_grids
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.gbuffer.context import FrameContext, ViewConstants
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance, require_same_objects
from iprt.geometry.pose import seen_from, view_from
from iprt.light_view import LightView
from iprt.method import GBuffer, Method, Setup, Signals
from iprt.settings.features import Features
from iprt.settings.methods import method
from iprt.settings.model import Settings
from iprt.view.composite import Composite
from iprt.view.real_layer import RealLayer
from iprt.world.objects.object_layers import VisibleLayer
from iprt.world.objects.objects import Objects
from iprt.world.real.camera_motion import CameraMotion
from iprt.world.shared import Worlds
from iprt.world.world import World


@dataclass(frozen=True)
class RenderedFrame:
    """Finished picture.

    Attributes
    ----------
    color : (H, W, 3) float32
        Linear radiance.
    aovs : dict of str to (H, W) or (H, W, 3) float32
        The requested auxiliary pictures.
    """

    color: NDArray[np.float32]
    aovs: dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class _Seen:
    """State of the last view frame: versions of the worlds, and the camera.

    Attributes
    ----------
    real, objects : int
        `RealWorld.version` and `Objects.version`.
    objects_moved : bool
        Objects had other positions in the previous frame.
    view, previous : View
        The frame's view and the previous frame's, in the axes of the capture centre.
    """

    real: int
    objects: int
    objects_moved: bool
    view: View
    previous: View


class Renderer:
    """Renderer that inserts objects into a 360° RGBD frame, for one view.

    Parameters
    ----------
    device : ComputeDevice
    frame : Frame
        The video frame.
    instances : iterable of Instance
        The objects to insert.
    view : View
        Equirect views show the whole panorama and cannot be rotated.
    settings : Settings
    background : (H, W, 3) float32 or None
        Linear radiance to composite over in place of the resampled panorama.
    footage : Footage or None
        Properties of frames that are loaded later. None: the same as of `frame`.
    worlds : Worlds or None
        The device's worlds, where several views share a scene.

    Attributes
    ----------
    fading : float
        Least share of a new frame in the temporal means from the next step on; initially from the
        settings.
    real_world : RealWorld
    method : Method or None
        Lighting method of the objects; None without objects.
    visible : VisibleLayer or None
        Surfaces of the objects in the view.
    light : LightView or None
        The method's view, if light has a lower resolution than the view.
    signals : Signals
        Components of the picture, after a frame.

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
        worlds: Worlds | None = None,
    ) -> None:
        self.settings = settings or Settings()
        self.fading = self.settings.fading
        self.device = device
        self.instances = tuple(instances)
        self.view = view
        self.background = background
        materials = [m for instance in self.instances for m in instance.mesh.materials]
        self.features = features = Features.of(
            materials,
            view,
            self.settings,
            footage or Footage.of(frame),
            deforming=any(instance.mesh.deforms for instance in self.instances),
        )
        self._frame_index = 0
        self._seen: _Seen | None = None
        self._placed = self.instances, frame.pose  # state that the objects follow

        self._camera: CameraMotion | None = None
        if features.moving_camera and frame.pose is not None:
            self._camera = CameraMotion(device, frame.pose)
        camera = None if self._camera is None else self._camera.rows

        self.layout = PlaneLayout.of(view)
        worlds = worlds or Worlds()
        self.real_world = worlds.real(device, frame, features)
        self._view_constants = ViewConstants(device, "view")
        self._grids = tracing_grids(device) if features.objects else []
        self.real = RealLayer(
            device,
            self.layout,
            name="real",
            gloss=features.gloss,
            camera=camera,
            color_map=features.color_map and features.relit,
            clipped=features.clipped,
            edges=True,
        )
        self.composite = Composite(device, self.layout)
        self.visible: VisibleLayer | None = None
        self.light: LightView | None = None
        self.method: Method | None = None
        self.signals = Signals()
        self._objects: Objects | None = None
        if features.objects:
            equirect = view.projection == "equirect"
            self.visible = VisibleLayer(device, self.layout, self.real.edges, equirect=equirect)
            gbuffer = GBuffer(self.real, self.visible)
            setup = Setup(device, view, self.layout, features, gbuffer, camera)
            if self.settings.light_scale > 1:
                self.light = light = LightView(device, gbuffer, view, features, camera)
                setup = Setup(device, light.view, light.layout, features, light.gbuffer, camera)
            self.method = method(self.settings.method).load()(setup)
            placed = seen_from(self.instances, frame.pose)
            self._objects = Objects(
                device, placed, view, self.real_world.panorama, features, worlds.hierarchy
            )
            self.world = World(self.real_world, self._objects)

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
        """Render one view frame; temporal passes continue from the previous ones."""
        real, objects = self.real_world, self._objects
        pose = real.frame.pose
        placed, placed_from = self._placed
        if objects is not None and (self.instances is not placed or pose is not placed_from):
            objects.move(seen_from(self.instances, pose))
            self._placed = self.instances, pose
        seen = self._look()
        context = self._context(seen)
        self._resample_real_layer(context)
        self.signals = Signals()
        if self.method is not None and self.visible is not None and objects is not None:
            objects.place(self.visible, seen.view, seen.previous, context)
            self.signals = self._light(self.method, seen, context)
        self._composite()
        self._frame_index += 1
        self._seen = seen
        self.device.profile.end_frame()

    def _look(self) -> _Seen:
        """Return the state of the worlds and of the camera in this frame."""
        view = view_from(self.view, self.real_world.frame.pose)
        before, objects = self._seen, 0 if self._objects is None else self._objects.version
        return _Seen(
            self.real_world.version,
            objects,
            before is not None and objects != before.objects,
            view,
            view if before is None else before.view,
        )

    def _context(self, now: _Seen) -> FrameContext:
        real, before, constants = self.real_world, self._seen, self._view_constants
        turned = constants.follow(now.view, now.previous)
        carried = False
        if self._camera is not None and real.frame.pose is not None:
            carried = self._camera.step(real.frame.pose)
        return FrameContext(
            self._frame_index,
            view=constants.current,
            previous=constants.previous,
            view_changed=turned or carried,
            video_changed=before is None or now.real != before.real,
            # Motion ends in the frame after the last one that moves the objects.
            objects_changed=before is None or now.objects_moved or before.objects_moved,
            fading=self.fading,
            grids=self._grids,
            cut=before is not None and real.cut_version > before.real,
        )

    def _resample_real_layer(self, context: FrameContext) -> None:
        real = self.real_world
        real.split_highlights()
        if context.view_changed or context.video_changed:
            self.real.show(real, context)
            if self.background is not None:
                self.real.replace_color(self.background, real.color_map)

    def _light(self, method: Method, seen: _Seen, context: FrameContext) -> Signals:
        if context.video_changed:
            method.prepare_video(self.world)
        if context.objects_changed:
            method.prepare_objects(self.world)
        if self.light is None:
            return method.trace(self.world, context)
        reduced = self.light.prepare(self.real_world, seen.view, seen.previous, context)
        return self.light.enlarge(method.trace(self.world, reduced), context.view)

    def _composite(self) -> None:
        visible, signals = self.visible, self.signals
        self.composite.run(
            self.real.color,
            other=self.real.other,
            other_pixel=self.real.other_pixel,
            corner=self.real.corner,
            ratio=signals.ratio,
            base=self.real.diffuse,
            change=signals.change,
            coverage=None if visible is None else visible.coverage,
            sides=None if visible is None else visible.sides,
            albedo=None if visible is None else visible.albedo,
            diffuse=signals.diffuse,
            specular=signals.specular,
            color_map=self.real_world.color_map,
        )

    @property
    def frame(self) -> Frame:
        """The current video frame."""
        return self.real_world.frame

    # Use ------------------------------------------------------------------------------------

    def load(self, frame: Frame) -> None:
        """Load another frame of the video; see `RealWorld.load`."""
        self.real_world.load(frame)

    def move(self, instances: Iterable[Instance]) -> None:
        """Move the objects.

        Parameters
        ----------
        instances : iterable of Instance
            The same objects, in the same order, with other transforms; and other vertices, where a
            mesh deforms.

        Raises
        ------
        SceneError
            The objects differ, or a transform is not 4x4 finite numbers. The renderer is unchanged.
        """
        moved = tuple(instances)
        require_same_objects(self.instances, moved)
        self.instances = moved

    def look(self, view: View) -> None:
        """Rotate the camera; size and projection stay."""
        assert (view.width, view.height) == (self.view.width, self.view.height)
        assert view.projection == self.view.projection
        self.view = view

    def render(
        self,
        frames: int = 1,
        aovs: Iterable[str] = (),
        progress: Callable[[int], None] | None = None,
    ) -> RenderedFrame:
        """Accumulate `frames` frames of the static scene and return the picture.

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
