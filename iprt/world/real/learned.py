"""Learned radiance of real surfaces, as shown by a video."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.world.real.learning import Learner, Learning

if TYPE_CHECKING:
    from iprt.settings.trace import LearningSettings
    from iprt.world.real.surfaces import Surfaces


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
        self._left, self._metre = 0, 1.0

    def follow(
        self, pose: NDArray[np.float64] | None, *, texels: int, scale: float, forget: bool
    ) -> None:
        """Go on to the video's next frame, which is learned from now on.

        Parameters
        ----------
        pose : (4, 4) float64 or None
            From the axes of the capture centre to the world's; None: the axes are the same.
        texels : int
            Number of texels of the panorama.
        scale : float
            `Panorama.scale`, metres.
        forget : bool
            Earlier frames showed another scene, or another light.
        """
        if forget:
            self.learner.forget()
            self._metre = scale
        self.learner.place(pose)
        self._left = texels

    def learn(self, surfaces: Surfaces, radiance: cla.Array, mean: float) -> None:
        """Learn from the next batch of texels, until every texel was drawn once on average.

        Parameters
        ----------
        surfaces : Surfaces
            Of the frame.
        radiance : (H, W, 3) float32
            Of its texels.
        mean : float
            Of that radiance, over the sphere.
        """
        if self._left <= 0:
            return
        own = self._settings
        self._left -= own.samples
        how = Learning(
            radius=own.search_radius * self._metre,
            metre=self._metre,
            unit=max(mean, 1e-20),
            forgetting=own.forgetting,
        )
        with self._device.profile.section("learn"):
            self.learner.learn(self.learner.draw(surfaces, radiance), how)

    def arguments(self) -> dict[str, Any]:
        """Return `LEARNED_PARAMETERS` of `cl/lib/world/real/learned.h`."""
        return self.learner.arguments()
