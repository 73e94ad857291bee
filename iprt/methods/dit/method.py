"""Distance impostor tracing (Rohmer, Jendersie and Grosch 2017, sections 6 and 7)."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.method import Setup, Signals
from iprt.methods.dit import DitSettings
from iprt.methods.dit.impostor import Impostor
from iprt.settings.features import Features
from iprt.trace.sparse import SparseMethod, Tracers
from iprt.trace.tracers import RealTracer
from iprt.world.world import World

SLACK = 0.25
"""While objects move, the map stays until their middle is so many of their radii from its centre:
section 6.1 wants a threshold by their size, and does not say which."""


class TraceCached(RealTracer):
    """Rays in those of the sampled directions that meet the boxes of objects."""

    def __init__(
        self, device: ComputeDevice, guide: Guide, features: Features, *, name: str, cache: int
    ) -> None:
        """`cache`: see `DitSettings`; 0: every direction is traced."""
        defines = plane_defines() | features.trace_defines()
        super().__init__(
            device,
            guide,
            features,
            "methods/dit/trace_cached",
            defines,
            name=name,
            cache_size=cache,
        )


class DistanceImpostorTracing(SparseMethod):
    """Places the impostor in the middle of the objects, and lets rays find the room in it.

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
        self._placed = False
        super().__init__(setup)

    def tracers(self) -> Tracers:
        if self._own.directions == "boxes":
            return Tracers()
        cache = self._own.cache if self._own.directions == "cached" else 0
        return Tracers(real=partial(TraceCached, cache=cache))

    def prepare_video(self, world: World) -> None:
        self._placed = False

    def trace(self, world: World, context: FrameContext) -> Signals:
        bounds = world.objects.bounds
        centre = middle_of(bounds)
        # Objects at rest have a map of their own place, however they came there.
        slack = SLACK * radius_of(bounds) if context.objects_changed else 0.0
        if not self._placed or np.linalg.norm(centre - self.impostor.centre) > slack:
            self.impostor.place(world.panorama, centre)
            self._placed = True
        world.impostor = self.impostor
        return super().trace(world, context)


def middle_of(bounds: NDArray[np.float32]) -> NDArray[np.float32]:
    """(3,) middle of all boxes (N, 2, 4)."""
    middle = 0.5 * (bounds[:, 0].min(axis=0) + bounds[:, 1].max(axis=0))
    return np.asarray(middle[:3], np.float32)


def radius_of(bounds: NDArray[np.float32]) -> float:
    """Half the diagonal of the box around all boxes (N, 2, 4)."""
    return 0.5 * float(np.linalg.norm((bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0))[:3]))
