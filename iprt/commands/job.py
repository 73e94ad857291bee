"""The job of `iprt render`."""

from __future__ import annotations

from dataclasses import dataclass

from iprt.device.compute import ComputeDevice
from iprt.device.profile import SAMPLED_S
from iprt.film import Film, view_at
from iprt.geometry.camera import View
from iprt.output.metadata import picture_metadata
from iprt.scene.scene import Scene, SceneView
from iprt.settings.model import Settings


@dataclass(frozen=True)
class Job:
    """A picture or video to render.

    Attributes
    ----------
    scene : Scene
    view : SceneView or View
    objects : tuple of str or None
        None: all.
    settings : Settings
    accumulate : int
        View frames per picture.
    aovs : tuple of str
    strict : bool
    device : str or None
        See `choose_device`.
    frame_limit : float
        Seconds.
    profiled : bool
        All frames are recorded in the device's profile; or else so few that it costs nothing.
    """

    scene: Scene
    view: SceneView | View
    objects: tuple[str, ...] | None
    settings: Settings
    accumulate: int
    aovs: tuple[str, ...]
    strict: bool
    device: str | None
    frame_limit: float
    profiled: bool

    def film(self, compute: ComputeDevice) -> Film:
        """The film that renders it."""
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

    def metadata(self, index: int, device: str) -> dict[str, str]:
        """See `picture_metadata`, of a frame of the video."""
        return picture_metadata(
            scene=self.scene.name,
            view=view_at(self.scene, self.view, index),
            objects=self.objects,
            settings=self.settings.model_dump(mode="json"),
            seed=self.settings.seed,
            frames=self.accumulate,
            device=device,
        )
