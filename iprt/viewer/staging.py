"""The stage to render: the scene's video, light and objects with all edits."""

from __future__ import annotations

from iprt.film import footage_of
from iprt.footage.daylight import Daylight
from iprt.footage.frame import Frame
from iprt.footage.properties import Footage
from iprt.footage.video.video_table import VideoTable
from iprt.scene.object_edits import ObjectEdit, edited_objects
from iprt.scene.objects import SceneObject, objects_at
from iprt.scene.scene import Scene
from iprt.viewer.accumulating_renderer import Stage
from iprt.viewer.object_states import ObjectState, object_states
from iprt.viewer.scene_files import Loaded, SceneFiles
from iprt.viewer.scene_light import LitScene, SceneLight
from iprt.viewer.shared_state import Snapshot
from iprt.viewer.state import World
from iprt.viewer.video_player import VideoPlayer

Objects = tuple[SceneObject, ...]


class Staging:
    """The stage, remade when a part of it changes; one thread calls `follow`.

    Parameters
    ----------
    files : SceneFiles
    light : SceneLight
    video : VideoPlayer

    Attributes
    ----------
    stage : Stage or None
        The newest stage; None before the scene and its frame are loaded.
    objects : tuple of ObjectState
        Objects of the newest stage; readable from any thread.
    edits : tuple of ObjectEdit
        Their edits.
    """

    def __init__(self, files: SceneFiles, light: SceneLight, video: VideoPlayer) -> None:
        self._files, self._light, self._video = files, light, video
        self._settled = 0  # number of the last change that is loaded completely
        self._objects: tuple[Objects, tuple[ObjectEdit, ...], Objects] | None = None
        self._daylight: tuple[LitScene, VideoTable, Daylight] | None = None
        self._frame: tuple[Frame, Daylight, Frame] | None = None
        self._footage: tuple[tuple[object, ...], Footage] | None = None
        self.stage: Stage | None = None
        self.objects: tuple[ObjectState, ...] = ()
        self.edits: tuple[ObjectEdit, ...] = ()

    def follow(self, wanted: Snapshot, *, shown: bool) -> Stage | None:
        """Return the stage to render, or None before the scene and its frame are loaded.

        Parameters
        ----------
        wanted : Snapshot
        shown : bool
            All clients see the current frame of the video.
        """
        loaded, world = self._files.loaded, wanted.world
        if loaded is None:
            return None
        self._light.follow(loaded, world.light)
        lit = self._light.lit
        if lit is None:
            return None
        self._video.follow(lit, world, shown=shown)
        unlit = self._video.frame
        if unlit is None:
            return None
        if self._video.is_of(lit):
            self._light.describe(unlit)
        frame = self._lit(unlit, self._daylight_of(loaded, lit, world))
        objects = self._edited(loaded, world)
        footage = self._footage_of(loaded.scene, frame, world)
        if self._video.arrived(world.playback):
            self._settled = wanted.number
        return self._staged(loaded, frame, objects, footage, world)

    def _staged(
        self, loaded: Loaded, frame: Frame, objects: Objects, footage: Footage, world: World
    ) -> Stage:
        known, settings = self.stage, world.settings
        if known is not None and known.number == self._settled:
            parts = (known.frame, known.objects, known.footage, known.settings)
            if all(a is b for a, b in zip(parts, (frame, objects, footage, settings), strict=True)):
                return known
        time_s = loaded.scene.time_of(frame.index)
        instances = objects_at(objects, time_s)
        self.objects = object_states(objects, instances, time_s, self.objects)
        self.edits = world.edits
        exposure = loaded.scene.exposure
        self.stage = Stage(
            self._settled, frame, objects, instances, footage, settings, exposure, time_s
        )
        return self.stage

    def _edited(self, loaded: Loaded, world: World) -> Objects:
        known = self._objects
        if known is None or known[0] is not loaded.objects or known[1] != world.edits:
            edited = edited_objects(loaded.objects, world.edits, loaded.origin.manifest.nits)
            self._objects = known = (loaded.objects, world.edits, edited)
        return known[2]

    def _daylight_of(self, loaded: Loaded, lit: LitScene, world: World) -> Daylight:
        video, known = world.light.applied(loaded.origin.manifest.video), self._daylight
        if known is None or known[0] is not lit or known[1] != video:
            self._daylight = known = (lit, video, lit.daylight(video))
        return known[2]

    def _lit(self, frame: Frame, daylight: Daylight) -> Frame:
        """Return the frame in its light, without reading it again."""
        known = self._frame
        if known is None or known[0] is not frame or known[1] is not daylight:
            self._frame = known = (frame, daylight, daylight.on(frame))
        return known[2]

    def _footage_of(self, scene: Scene, frame: Frame, world: World) -> Footage:
        """Return the video's footage, based on the first frame that was shown in this light."""
        fed, known = self._video.fed, self._footage
        # The disc of a sun that is dragged comes and goes; kernels for it stay.
        stays = known is not None and known[0][0] is fed and known[1].clips
        clips = stays or frame.clipped is not None
        made_of = (fed, world.settings, frame.sun is None, clips)
        if known is None or known[0] != made_of:
            if len(scene.frame_indices) > 1:
                footage = footage_of(scene, frame, world.settings)
            else:
                footage = Footage.of(frame, clips=clips)
            self._footage = known = made_of, footage
        return known[1]
