"""Renderer: the work on each clock, and its order. Read this file first.

`RealWorld` lists the passes of a video frame, and `Renderer` the passes of a view frame. `Schedule`
runs the passes that are due. `Features` tells which ones a scene needs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from iprt.aovs import read_aov
from iprt.compositing.composite import Composite
from iprt.compositing.drawing import Drawing
from iprt.compositing.object_layer import VisibleLayer
from iprt.compositing.real_layer import REAL_LAYER_READS, RealLayer
from iprt.device.compute import ComputeDevice
from iprt.filter.mask import tracing_grids
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.gbuffer.context import FrameContext, ViewConstants
from iprt.gbuffer.layout import PlaneLayout
from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance, require_same_objects, same_places
from iprt.geometry.pose import seen_from, view_from
from iprt.light_view import LightView
from iprt.method import GBuffer, Method, Setup, Signals
from iprt.passes import Clock, Pass, Schedule
from iprt.settings.features import Features
from iprt.settings.methods import method
from iprt.settings.model import Settings
from iprt.world.objects.lamps import have_lamp_tree
from iprt.world.objects.objects import Objects
from iprt.world.objects.sunlit import Sunlit
from iprt.world.real.camera_motion import CameraMotion
from iprt.world.shared import Worlds
from iprt.world.world import World

MOVING_FADING, MOVING_REFLECTED_FADING = 2.0, {False: 3.0, True: 2.0}
"""Factors of `Settings.fading` while objects move: of real surfaces, and without and with glass."""


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
class _Moment:
    """Moment of a view frame on the clocks.

    Attributes
    ----------
    real, objects : int
        Versions of the video's and the objects' clock.
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
    schedule : Schedule
        Passes of a view frame.

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
            lights=any(instance.mesh.light is not None for instance in self.instances),
            many_lamps=have_lamp_tree(self.instances),
            deforming=any(instance.mesh.deforms for instance in self.instances),
        )
        self._frame_index = 0
        self._last: _Moment | None = None

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
        self._objects: Objects | None = None
        if features.objects:
            self.visible = VisibleLayer(device, self.layout, self.real.edges, features.materials)
            gbuffer = GBuffer(self.real, self.visible)
            setup = Setup(device, view, self.layout, features, gbuffer, camera)
            if self.settings.light_scale > 1:
                self.light = light = LightView(device, gbuffer, view, features, camera)
                setup = Setup(device, light.view, light.layout, features, light.gbuffer, camera)
            self.method = method(self.settings.method).load()(setup)
            panorama, placed = self.real_world.panorama, seen_from(self.instances, frame.pose)
            self._objects = objects = Objects(
                device, placed, view, panorama.height, features, worlds.hierarchy
            )
            self._drawing = Drawing(device, self.visible, objects, panorama, view, features)
            self.world = World(self.real_world, objects)
        self._placed = self.instances, frame.pose  # state that the objects follow
        self._displaced = False  # in the world; a moving camera moves them in its axes
        self.schedule = Schedule(self._passes(), device.profile, self.real_world.shown)
        self.schedule.tick(Clock.OBJECTS)

    def close(self) -> None:
        """Release the OpenGL context, and the buffers with the last reference to the renderer.

        No frame can be rendered any more.
        """
        if self._objects is not None:
            self._drawing.close()
        # Its passes refer to the renderer: Python would find that cycle only later.
        vars(self).pop("schedule", None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # The frame ------------------------------------------------------------------------------

    def _passes(self) -> list[Pass[FrameContext]]:
        """Return the passes of a view frame; `RealWorld` has the list of a video frame."""
        passes = [Pass("resample", Clock.VIEW, self._resample, REAL_LAYER_READS, ("real layer",))]
        objects, method = self._objects, self.method
        if objects is not None and method is not None:
            moved = Clock.MOTION if self.features.deforming else Clock.OBJECTS
            passes.append(Pass("hierarchy", moved, lambda _: objects.place(), (), ("hierarchy",)))
            if objects.sunlit is not None:
                passes.append(self._find_sunlit(objects, objects.sunlit))
            passes += self._drawing.passes()
            light = self.light
            lit = method.passes(self.world) if light is None else light.passes(self.world, method)
            passes += lit
        shown = ("real layer", "object layer", "ratio", "reflected light")
        return [*passes, Pass("composite", Clock.FRAME, self._composite, shown, ("picture",))]

    def _find_sunlit(self, objects: Objects, sunlit: Sunlit) -> Pass[FrameContext]:
        """Return the pass that marks objects that the sun may reach."""
        panorama, seen = self.real_world.panorama, ("hierarchy", "radiance", "pyramid")

        def find(_: FrameContext) -> None:
            sunlit.find(panorama, objects.device_bounds)

        return Pass("sunlit objects", Clock.OBJECTS, find, seen, ("sunlit objects",))

    def step(self) -> None:
        """Render one view frame; temporal passes continue from the previous ones."""
        self.real_world.prepare()
        self._move_objects()
        now = self._look()
        context = self._begin(now)
        if self.light is not None:
            self.light.begin(context)
        self.schedule.walk(context)
        self._frame_index += 1
        self._last = now
        self.device.profile.end_frame()

    def _move_objects(self) -> None:
        """Let the objects follow their instances and the 360° camera."""
        pose = self.real_world.frame.pose
        placed, placed_from = self._placed
        self._displaced = self.instances is not placed and not same_places(placed, self.instances)
        if self._objects is None or (self.instances is placed and pose is placed_from):
            return
        if self._objects.move(seen_from(self.instances, pose)):
            self.schedule.tick(Clock.OBJECTS)
        self._placed = self.instances, pose

    def _look(self) -> _Moment:
        """Return the versions of the worlds, and the camera, in this frame."""
        view = view_from(self.view, self.real_world.frame.pose)
        last, objects = self._last, self.schedule.versions[Clock.OBJECTS]
        return _Moment(
            self.real_world.version,
            objects,
            last is not None and objects != last.objects,
            view,
            view if last is None else last.view,
        )

    def _begin(self, now: _Moment) -> FrameContext:
        """Let the clocks tick that go on in this frame, and return its state."""
        real, last, constants = self.real_world, self._last, self._view_constants
        tick = self.schedule.tick
        tick(Clock.FRAME)
        if constants.follow(now.view, now.previous):
            tick(Clock.VIEW)
        camera, pose = self._camera, real.frame.pose
        if camera is not None and pose is not None and camera.step(pose):
            tick("camera motion")
        # Motion ends in the frame after the last one that moves the objects.
        moving = last is None or now.objects_moved or last.objects_moved
        if moving:
            tick(Clock.MOTION)
        # Histories follow moving objects only approximately: a shorter memory blurs them less.
        reflected = MOVING_REFLECTED_FADING[self.features.materials.glass]
        factors = (MOVING_FADING, reflected) if self._displaced else (1.0, 1.0)
        fading, reflected_fading = (min(factor * self.fading, 1.0) for factor in factors)
        return FrameContext(
            self._frame_index,
            camera=now.view,
            previous_camera=now.previous,
            view=constants.current,
            previous=constants.previous,
            moved=now.objects_moved,
            moving=moving,
            changed=last is not None and (moving or now.real != last.real),
            fading=fading,
            reflected_fading=reflected_fading,
            grids=self._grids,
            cut=last is not None and real.cut_version > last.real,
        )

    def _resample(self, context: FrameContext) -> None:
        self.real.show(self.real_world, context)
        if self.background is not None:
            self.real.replace_color(self.background, self.real_world.color_map)

    @property
    def signals(self) -> Signals:
        """Components of the picture, after a frame."""
        if self.light is not None:
            return self.light.signals
        return Signals() if self.method is None else self.method.signals

    def _composite(self, _: FrameContext) -> None:
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
            metallic=None if visible is None else visible.metallic,
            diffuse=signals.diffuse,
            specular=signals.specular,
            emission=None if visible is None else visible.emission,
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
