"""Distance impostor tracing (Rohmer, Jendersie and Grosch 2017, sections 6 and 7)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.gbuffer.context import FrameContext
from iprt.method import Setup
from iprt.methods.dit import DitSettings
from iprt.methods.dit.impostor import Impostor
from iprt.passes import Clock, Pass
from iprt.trace.sparse import SparseMethod
from iprt.trace.tracers import RayKernel, RayKernels
from iprt.world.world import World

SLACK = 0.25
"""Threshold for moving the map: distance of the objects' middle from its centre, relative to their
radius. Section 6.1 requires a threshold that depends on their size, and gives no value."""


class DistanceImpostorTracing(SparseMethod):
    """Ray tracing against an impostor of the room, centred at the objects.

    Attributes
    ----------
    impostor : Impostor
    """

    def __init__(self, setup: Setup) -> None:
        features = setup.features
        self._own = features.settings.own(DitSettings)
        self.impostor = Impostor(
            setup.device,
            self._own.resolution,
            self._own.iterations,
            light_sampling=features.light_sampling,
        )
        super().__init__(setup)

    def kernels(self) -> RayKernels:
        """Return the kernels for the setting `directions`."""
        kernels, own = super().kernels(), self._own
        if own.directions == "boxes":
            return kernels
        cache = own.cache if own.directions == "cached" else 0  # 0 traces every direction
        defines, scene = self.setup.features.trace_defines(), kernels.real.scene
        cached = RayKernel("methods/dit/trace_cached", defines, scene, {"cache_size": cache})
        return replace(kernels, real=cached)

    def prepare(self, world: World) -> list[Pass[FrameContext]]:
        """Build the impostor of each video frame, and again where objects leave its centre."""
        world.impostor = self.impostor

        def build(_: FrameContext) -> None:
            self.impostor.place(world.panorama, middle_of(world.objects.bounds))

        def follow(context: FrameContext) -> None:
            bounds = world.objects.bounds
            away = np.linalg.norm(middle_of(bounds) - self.impostor.centre)
            # At rest it is centred at the objects, so that it does not depend on their path.
            if away > (SLACK * radius_of(bounds) if context.moving else 0.0):
                build(context)

        seen, built = ("surfaces", "radiated"), ("impostor",)
        return [
            Pass("impostor", Clock.VIDEO, build, seen, built),
            Pass("impostor", Clock.FRAME, follow, seen, built),
        ]


def middle_of(bounds: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the middle (3,) of the box around boxes (N, 2, 4)."""
    middle = 0.5 * (bounds[:, 0].min(axis=0) + bounds[:, 1].max(axis=0))
    return np.asarray(middle[:3], np.float32)


def radius_of(bounds: NDArray[np.float32]) -> float:
    """Return half the diagonal of the box around boxes (N, 2, 4)."""
    return 0.5 * float(np.linalg.norm((bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0))[:3]))
