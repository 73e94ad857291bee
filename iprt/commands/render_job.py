"""The job of `iprt render`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from iprt.commands.progress import ProgressKind
from iprt.convergence import Goal
from iprt.device.compute import ComputeDevice
from iprt.device.profile import SAMPLED_S
from iprt.film import Film, view_at
from iprt.geometry.camera import View
from iprt.output.encode import CodecName
from iprt.output.metadata import picture_metadata
from iprt.scene.scene import Scene
from iprt.scene.scene_view import SceneView
from iprt.settings.model import Settings


@dataclass(frozen=True)
class RenderJob:
    """Picture or video to render.

    Attributes
    ----------
    scene : Scene
    output : Path
    frames : range
        Numbers of the video's frames; a still picture has the first.
    view : SceneView or View
    objects : tuple of str or None
        None: all.
    settings : Settings
    accumulate : int
        View frames per picture; with `converged`, their maximum.
    converged : float or None
        Noise at which a still picture is finished, see `Goal`.
    aovs : tuple of str
    codec : {"h264", "hevc"}
    audio : bool
        Keep the sound of the source video in a video file.
    chunk : int
        Frames of a chunk of a video.
    strict : bool
    device : str or None
        See `choose_device`.
    frame_limit : float
        Longest time of a frame, seconds.
    profiled : bool
        Record all frames in the device's profile; otherwise only a few, at no noticeable cost.
    progress : {"bar", "lines", "openjd"}
        See `progress_bar`.
    """

    scene: Scene
    output: Path
    frames: range
    view: SceneView | View
    objects: tuple[str, ...] | None
    settings: Settings
    accumulate: int
    converged: float | None
    aovs: tuple[str, ...]
    codec: CodecName
    audio: bool
    chunk: int
    strict: bool
    device: str | None
    frame_limit: float
    profiled: bool
    progress: ProgressKind

    def film(self, compute: ComputeDevice) -> Film:
        """Return the film that renders the job."""
        compute.profile.every_s = 0.0 if self.profiled else SAMPLED_S
        return Film(
            self.scene,
            compute,
            self.settings,
            view=self.view,
            objects=self.objects,
            accumulate=self.accumulate,
            strict=self.strict,
        )

    def goal(self) -> Goal | None:
        """Return the noise goal of a still picture; None: `accumulate` frames are rendered."""
        if self.converged is None:
            return None
        return Goal(self.converged, self.accumulate, self.scene.exposure)

    def metadata(self, index: int, device: str, goal: Goal | None = None) -> dict[str, str]:
        """Return the `picture_metadata` of a frame of the video that was rendered to `goal`."""
        return picture_metadata(
            scene=self.scene.name,
            view=view_at(self.scene, self.view, index),
            objects=self.objects,
            settings=self.settings.model_dump(mode="json"),
            seed=self.settings.seed,
            frames=self.accumulate if goal is None else goal.frames,
            device=device,
            noise=None if goal is None else goal.reached,
        )
