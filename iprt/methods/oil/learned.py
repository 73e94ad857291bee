"""Learned radiance of real surfaces, as shown by a video."""

from __future__ import annotations

from typing import Any

from iprt.device.compute import ComputeDevice
from iprt.settings.trace import LearningSettings
from iprt.world.real.learning import Learner, Learning
from iprt.world.real.panorama import Panorama
from iprt.world.real.real_world import RealWorld


class LearnedRadiance:
    """Models of the radiance of real surfaces, updated from frame to frame of a video.

    Models stay with their surfaces, in the axes of the world, while the camera moves.

    Attributes
    ----------
    learner : Learner
    """

    def __init__(self, device: ComputeDevice, settings: LearningSettings) -> None:
        self._device, self._settings = device, settings
        self.learner = Learner(device, settings.samples, settings.models)
        self._version, self._left, self._metre = 0, 0, 1.0

    def follow(self, real: RealWorld) -> None:
        """Go on to the video's next frame, which is learned from now on.

        Models are forgotten where the video shows another scene, or another light.
        """
        panorama = real.panorama
        if self._version == 0 or real.cut_version > self._version:
            self.learner.forget()
            self._metre = panorama.scale
        self._version = real.version
        self.learner.place(real.frame.pose)
        self._left = panorama.width * panorama.height

    def learn(self, panorama: Panorama) -> None:
        """Learn from the next batch of texels, until every texel was drawn once on average."""
        if self._left <= 0:
            return
        own = self._settings
        self._left -= own.samples
        how = Learning(
            radius=own.search_radius * self._metre,
            metre=self._metre,
            unit=max(panorama.mean_radiance, 1e-20),
            forgetting=own.forgetting,
        )
        with self._device.profile.section("learn"):
            self.learner.learn(self.learner.draw(panorama.surfaces, panorama.radiated), how)

    def arguments(self) -> dict[str, Any]:
        """Return `LEARNED_PARAMETERS` of `cl/lib/world/real/learned.h`."""
        return self.learner.arguments()
