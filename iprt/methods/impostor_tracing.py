"""Distance impostor tracing (Rohmer, Jendersie and Grosch 2017, sections 6 and 7)."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import Mask
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide, plane_defines
from iprt.methods.dit import DitSettings
from iprt.methods.protocol import Setup, Signals
from iprt.methods.sparse import SparseMethod, Tracers
from iprt.methods.trace import traced_arguments
from iprt.settings.features import Features
from iprt.world.real.impostor import Impostor
from iprt.world.real.irradiance import IrradianceCache
from iprt.world.world import World


class TraceCached:
    """Changes of irradiance by objects, at the traced pixels of a real layer.

    Attributes
    ----------
    signal : 6 planes
        Valid at the pixels that were traced: irradiance that objects hide, and that they send,
        over E_R.
    """

    def __init__(
        self, device: ComputeDevice, guide: Guide, features: Features, *, name: str, cache: int
    ) -> None:
        """`cache`: see `DitSettings`; 0: every direction is traced."""
        self._device, self._guide, self._features = device, guide, features
        layout = guide.layout
        self.signal = device.zeros(f"{name} signal", layout.shape(6))
        defines = plane_defines() | features.trace_defines()
        self._kernel = device.kernel("methods/trace_cached.cl", "trace_cached", defines).fixed(
            layout.arguments(),
            rays=features.settings.trace.rays,
            frame_seed=features.settings.seed,
            cache_size=cache,
            samples=device.zeros(f"{name} samples", layout.shape(1), np.uint32),
            signal=self.signal,
        )

    def run(
        self,
        world: World,
        mask: Mask,
        view: cla.Array,
        cache: IrradianceCache | None,
        *,
        min_solid_angle: float,
    ) -> None:
        """See `iprt.methods.trace.TraceReal`; objects that look small are not left out."""
        del min_solid_angle
        assert cache is not None
        guide = self._guide
        with self._device.profile.section("trace real"):
            self._kernel(
                (guide.layout.width * guide.layout.height,),
                traced_arguments(guide, mask, view),
                world.arguments(self._features),
                cache.arguments(world.panorama),
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
        centre = middle_of(world.objects.bounds)
        if not self._placed or not np.array_equal(centre, self.impostor.centre):
            self.impostor.place(world.panorama, centre)
            self._placed = True
        world.impostor = self.impostor
        return super().trace(world, context)


def middle_of(bounds: NDArray[np.float32]) -> NDArray[np.float32]:
    """(3,) middle of all boxes (N, 2, 4)."""
    middle = 0.5 * (bounds[:, 0].min(axis=0) + bounds[:, 1].max(axis=0))
    return np.asarray(middle[:3], np.float32)
