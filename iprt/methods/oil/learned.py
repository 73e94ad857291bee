"""Radiance of real surfaces, learned from a video."""

from __future__ import annotations

from iprt.device.compute import ComputeDevice
from iprt.settings.trace import LearningSettings
from iprt.world.real.panorama import Panorama
from iprt.world.real.radiance_models import Drawn, LearnedArgs, Learner, Learning
from iprt.world.real.real_world import RealWorld


class LearnedRadiance:
    """Models of the radiance of real surfaces, updated from frame to frame of a video.

    The models stay with their surfaces, in world space, while the camera moves.

    Attributes
    ----------
    learner : Learner
    """

    def __init__(self, device: ComputeDevice, settings: LearningSettings) -> None:
        self._settings = settings
        self.learner = Learner(device, settings.samples, settings.models)
        self._version, self._left, self._metre = 0, 0, 1.0
        self._drawn: Drawn | None = None
        self._new = True

    def follow(self, real: RealWorld) -> None:
        """Start to learn from the video's next frame.

        All models are dropped when the scene or its light changes.
        """
        panorama = real.panorama
        if self._version == 0 or real.cut_version > self._version:
            self.learner.forget()
            self._new = True
            self._metre = panorama.scale
        self._version = real.version
        self.learner.place(real.frame.pose)
        self._left = panorama.width * panorama.height

    def learn(self, panorama: Panorama) -> None:
        """Learn from a batch of random texels, up to the number of texels of the video's frame.

        Each but the first is drawn one view frame ahead, so that the host need not wait for it.
        """
        if self._new:
            self._draw(panorama)
            self._new = False
        if self._drawn is not None:
            samples, covered = self._drawn()
            how = Learning(
                radius=self._settings.search_radius * self._metre,
                metre=self._metre,
                unit=max(panorama.mean_radiance, 1e-20),
                forgetting=self._settings.forgetting,
            )
            self.learner.learn(samples, how, covered)
        self._draw(panorama)

    def _draw(self, panorama: Panorama) -> None:
        """Start to draw the next batch, if the video's frame has one left."""
        self._drawn = None
        if self._left > 0:
            self._left -= self._settings.samples
            self._drawn = self.learner.draw(panorama.surfaces, panorama.radiated)

    def arguments(self) -> LearnedArgs:
        """Return the models for kernels that ask them."""
        return self.learner.arguments()
